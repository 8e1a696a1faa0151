'use strict';

/**
 * Shapes on a canvas, for arm.js: lengths in px, angles in rad, y downward. `colours` are those of a
 * view.
 */
const Shapes = (() => {
  function line(context, points, colour, width, alpha = 1, dash = []) {
    context.save();
    context.globalAlpha = alpha;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineJoin = context.lineCap = 'round';
    context.setLineDash(dash);
    context.beginPath();
    points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
    context.restore();
  }

  /** Fills the path with a tint of a colour on paper and draws its edge. */
  function tinted(context, colours, colour, edge = colour, tint = 0.28) {
    context.fillStyle = colours.paper;
    context.fill();
    context.save();
    context.globalAlpha *= tint;
    context.fillStyle = colour;
    context.fill();
    context.restore();
    context.strokeStyle = edge;
    context.lineWidth = 1.5;
    context.stroke();
  }

  function disc(context, x, y, radius) {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
  }

  function box(context, x, y, width, height, radius = 2) {
    context.beginPath();
    context.roundRect(x, y, width, height, radius);
  }

  /** Arrow from (x, y) along `angle` (rad, clockwise from the right, as canvases have it). */
  function arrow(context, x, y, length, angle, colour, width = 3) {
    if (Math.abs(length) < 2) return;
    const head = Math.min(11, 0.6 * Math.abs(length));
    context.save();
    context.translate(x, y);
    context.rotate(length < 0 ? angle + Math.PI : angle);
    const end = Math.abs(length);
    line(context, [[0, 0], [end - head, 0]], colour, width);
    context.fillStyle = colour;
    context.beginPath();
    context.moveTo(end, 0);
    context.lineTo(end - head, -0.5 * head);
    context.lineTo(end - head, 0.5 * head);
    context.fill();
    context.restore();
  }

  /** Arc about (x, y) from `start` by `sweep`, in rad counterclockwise, with a head. */
  function arcArrow(context, x, y, radius, start, sweep, colour) {
    if (Math.abs(sweep) * radius < 2) return;
    const head = Math.min(11, 0.7 * radius, 0.6 * Math.abs(sweep) * radius);
    const side = Math.sign(sweep), neck = sweep - side * head / radius;
    context.save();
    context.translate(x, y);
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 3;
    context.beginPath();
    context.arc(0, 0, radius, -start, -start - neck, side > 0);
    context.stroke();
    context.beginPath();
    for (const [r, angle] of [[radius, sweep], [radius - head / 2, neck], [radius + head / 2, neck]]) {
      context.lineTo(r * Math.cos(start + angle), -r * Math.sin(start + angle));
    }
    context.fill();
    context.restore();
  }

  /** Quartered disc: a centre of mass. */
  function centreOfMass(context, colours, x, y, radius) {
    disc(context, x, y, radius);
    context.fillStyle = colours.paper;
    context.fill();
    context.strokeStyle = context.fillStyle = colours.ink;
    context.lineWidth = 1.2;
    context.stroke();
    for (const turn of [0, Math.PI]) {
      context.beginPath();
      context.moveTo(x, y);
      context.arc(x, y, radius, turn - Math.PI / 2, turn);
      context.fill();
    }
  }

  /** Padlock: friction holds the joint. */
  function padlock(context, colours, x, y) {
    disc(context, x, y, 9);
    context.fillStyle = colours.paper;
    context.fill();
    context.strokeStyle = context.fillStyle = colours.accent;
    context.lineWidth = 1.6;
    context.stroke();
    context.beginPath();
    context.arc(x, y - 1.5, 2.6, Math.PI, 0);
    context.stroke();
    context.fillRect(x - 4, y - 1.5, 8, 6);
  }

  /** Two chevrons at (x, y) along `angle` (rad, as canvases have it): the joint slides this way. */
  function chevrons(context, colours, x, y, angle) {
    context.save();
    context.translate(x, y);
    context.rotate(angle);
    for (const at of [-4, 3]) {
      line(context, [[at - 2, -5], [at + 3, 0], [at - 2, 5]], colours.accent, 2.4);
    }
    context.restore();
  }

  return {line, tinted, disc, box, arrow, arcArrow, centreOfMass, padlock, chevrons};
})();
