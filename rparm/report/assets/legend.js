'use strict';

/**
 * The legend below a drawing of arm.js: its scales, with samples, and what its marks mean. Load
 * shapes.js before.
 */
const Legend = (() => {
  const LONGEST = 72; // px, of the arrow of the largest force
  const WIDEST = (4 / 3) * Math.PI; // rad, of the arc of the largest torque
  const ROW = 22; // px
  const FONT = '12px system-ui, sans-serif';
  const ruled = new OffscreenCanvas(1, 1).getContext('2d'); // measures texts
  ruled.font = FONT;

  /** What a view needs: [kind of the sample, text]. */
  function entries(view) {
    const number = x => String(Number(x.toPrecision(3)));
    const found = [['length', `${number(view.length)} m`]];
    if (view.torque) found.push(['torque', `τ₁ ${number(view.torque / 2)} N·m`]);
    if (view.force) found.push(['force', `f₂ ${number(view.force / 2)} N`]);
    if (view.contact) found.push(['contact', `force on the tip ${number(view.contact / 2)} N`]);
    if (view.trace) found.push(['trace', 'path']);
    if (view.ghost) found.push(['ghost', 'reference']);
    if (view.modes) found.push(['held', 'held by friction'], ['slides', 'slides']);
    if (view.stops) found.push(['stop', 'at its stop']);
    if (view.wall) found.push(['wall', 'wall']);
    if (view.gravity) found.push(['gravity', 'gravity']);
    else if (view.gravity === 0) found.push(['plane', 'horizontal plane']);
    return found;
  }

  const SWATCHES = {torque: 34, force: LONGEST / 2 + 6, contact: LONGEST / 2 + 6, trace: 26,
    ghost: 31, held: 22, slides: 20, stop: 14, wall: 22, gravity: 14, plane: 0};

  /** Places of the legend's entries below the drawing: {kind, text, x, row}, px. */
  function placed(view) {
    let x = 12, row = 0;
    return entries(view).map(([kind, text]) => {
      const swatch = kind === 'length' ? view.length * view.scale + 8 : SWATCHES[kind];
      const width = swatch + ruled.measureText(text).width;
      if (x + width > view.width - 8 && x > 12) [x, row] = [12, row + 1];
      const place = {kind, text, x, row, swatch};
      x += width + 16;
      return place;
    });
  }

  /** Height of the strip below the drawing, px. */
  function height(places) {
    return ROW * (places.at(-1).row + 1) + 8;
  }

  /** A length: a bar with ends. */
  function ruler(context, colour, x, y, length) {
    Shapes.line(context, [[x, y - 4], [x, y + 4]], colour, 1.5);
    Shapes.line(context, [[x, y], [x + length, y]], colour, 1.5);
    Shapes.line(context, [[x + length, y - 4], [x + length, y + 4]], colour, 1.5);
  }

  /** Samples, drawn as in the picture, half as large as the largest. */
  const SAMPLES = {
    length: (context, view, x, y) =>
      ruler(context, view.colours.ink, x, y, view.length * view.scale),
    torque: (context, view, x, y) =>
      Shapes.arcArrow(context, x + 13, y + 4, 11, Math.PI / 6, WIDEST / 2, view.colours.effort),
    force: (context, view, x, y) =>
      Shapes.arrow(context, x, y, LONGEST / 2, 0, view.colours.effort),
    contact: (context, view, x, y) =>
      Shapes.arrow(context, x, y, LONGEST / 2, 0, view.colours.bad, 3.4),
    trace: (context, view, x, y) =>
      Shapes.line(context, [[x, y], [x + 20, y]], view.colours.good, 2.6),
    ghost: (context, view, x, y) => {
      Shapes.line(context, [[x + 5, y], [x + 18, y]], view.colours.reference, 11);
      Shapes.line(context, [[x + 5, y], [x + 18, y]], view.colours.paper, 7);
    },
    held: (context, view, x, y) => Shapes.padlock(context, view.colours, x + 6, y),
    slides: (context, view, x, y) => Shapes.chevrons(context, view.colours, x + 7, y, 0),
    stop: (context, view, x, y) => {
      Shapes.box(context, x, y - 6, 7, 12);
      Shapes.tinted(context, view.colours, view.colours.stop, undefined, 1);
    },
    wall: (context, view, x, y) => {
      for (let i = 0; i < 3; i++) {
        Shapes.line(context, [[x + 6 * i + 2, y - 3], [x + 6 * i - 2, y + 5]], view.colours.stop, 1);
      }
      Shapes.line(context, [[x - 1, y - 4], [x + 16, y - 4]], view.colours.stop, 2.5);
    },
    gravity: (context, view, x, y) =>
      Shapes.arrow(context, x + 4, y - 8, 16, Math.PI / 2, view.colours.ink, 2),
    plane: () => {},
  };

  function draw(context, view) {
    const top = view.height - view.strip + 14;
    context.font = FONT;
    context.textBaseline = 'middle';
    for (const {kind, text, x, row, swatch} of view.entries) {
      SAMPLES[kind](context, view, x, top + row * ROW);
      context.fillStyle = view.colours.ink;
      context.fillText(text, x + swatch, top + row * ROW);
    }
  }

  return {LONGEST, WIDEST, ROW, placed, height, draw};
})();
