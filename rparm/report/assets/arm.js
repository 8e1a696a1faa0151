'use strict';

/**
 * Draws the planar RP arm, to scale, on a canvas: `Arm.fit` gives a view, `Arm.draw` draws a scene.
 * Frames and symbols are those of models/rp_manipulator/README.md. Nothing here touches the page;
 * load shapes.js and legend.js before.
 *
 * Points are [x, y] in frame 0, in m. On link 1 a point has the coordinates `along` z1 and `across`,
 * along x1. A scene is { arm, q1, q2, ghost, tau1, f2, ee_fx, ee_fy, payload_attached,
 * payload_waits, mode1, mode2, trace }, in SI units; what is null or missing is not drawn.
 */
const Arm = (() => {
  const HELD = 0, FREE = 2; // values of mode1 and mode2; -1 and 1: slides backward, forward
  const {LONGEST, WIDEST} = Legend;
  const TURN = 1.9 * Math.PI; // rad, the most of an arc
  const AT_STOP = 1e-6; // of the range between two stops

  // ---- geometry

  /** Points of the arm at the joint variables q1 (rad) and q2 (m); `mass1` may be null. */
  function forward(arm, q1, q2) {
    const s = Math.sin(q1), c = Math.cos(q1);
    const at = (along, across) => [along * c - across * s, along * s + across * c];
    const L = arm.l1 + q2;
    const {x, z} = arm.payload ?? {x: 0, z: 0};
    const tip = arm.wall ?? {tip_x: 0, tip_z: 0};
    return {
      pivot: [0, 0],
      elbow: at(arm.l1, 0),
      sleeve: at(arm.l1, arm.a),
      endEffector: at(L, arm.a),
      mass1: arm.lc1 == null ? null : at(arm.lc1, 0),
      payload: at(L + z, arm.a + x),
      tip: at(L + tip.tip_z, arm.a + tip.tip_x),
    };
  }

  /** Which stop a joint is at: -1 lower, 1 upper, 0 none. */
  function stopOf(limits, q) {
    if (!limits) return 0;
    const near = AT_STOP * (limits[1] - limits[0]);
    if (q <= limits[0] + near) return -1;
    return q >= limits[1] - near ? 1 : 0;
  }

  // ---- view

  const range = values => values.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)],
    [Infinity, -Infinity]);
  const largest = values => (values ?? []).reduce((most, x) => Math.max(most, Math.abs(x)), 0);

  /** 1, 2 or 5 times a power of ten, not below x; null for 0. */
  function round(x) {
    if (!(x > 0)) return null;
    const power = 10 ** Math.floor(Math.log10(x));
    return [1, 2, 5, 10].map(step => step * power).find(value => value >= x * (1 - 1e-9));
  }

  /**
   * What a motion covers: a box (m), the range of q2, the largest efforts, and what the legend has
   * to explain. `fit` also takes such an object that is made otherwise; only the box is necessary.
   */
  function extent(motion) {
    const {arm, reference} = motion;
    const slide = arm.stops?.q2 ?? range([...motion.q2, ...(reference?.q2 ?? [])]);
    const box = {left: 0, right: 0, bottom: 0, top: 0, slide};
    const cover = ([x, y]) => {
      box.left = Math.min(box.left, x);
      box.right = Math.max(box.right, x);
      box.bottom = Math.min(box.bottom, y);
      box.top = Math.max(box.top, y);
    };
    const seen = ['elbow', 'sleeve', 'endEffector', 'tip'];
    if (motion.payload_attached?.includes(true)) seen.push('payload');
    const coverArm = (q1, q2) => {
      const points = forward(arm, q1, q2);
      for (const name of seen) cover(points[name]);
      // the ends of link 2, which reaches its sleeve wherever it is
      for (const end of slide) cover(forward(arm, q1, q2 - end).endEffector);
    };
    motion.q1.forEach((q1, row) => coverArm(q1, motion.q2[row]));
    reference?.q1.forEach((q1, row) => coverArm(q1, reference.q2[row]));
    const forces = motion.ee_fx?.map((x, row) => Math.hypot(x, motion.ee_fy?.[row] ?? 0));
    return {
      ...box,
      torque: largest(motion.tau1),
      force: largest(motion.f2),
      contact: largest(forces ?? motion.ee_fy),
      gravity: arm.g,
      ghost: reference != null,
      modes: [...(motion.mode1 ?? []), ...(motion.mode2 ?? [])].some(mode => mode !== FREE),
      stops: (arm.stops?.q1 ?? arm.stops?.q2) != null,
      wall: isNear(arm.wall, box),
      trace: true,
    };
  }

  /** Whether the surface of a wall passes through a box, or close by. */
  function isNear(wall, box) {
    if (!wall) return false;
    const nx = Math.cos(wall.angle), ny = Math.sin(wall.angle), near = 0.05; // m
    const heights = [box.left, box.right].flatMap(x => [box.bottom, box.top].map(
      y => nx * x + ny * y - wall.position));
    return Math.min(...heights) < near && Math.max(...heights) > -near;
  }

  /** Room around what moves, px. */
  const margin = width => Math.max(24, Math.min(width / 14, 40));

  /**
   * View of a canvas of `width` times `height` px in which a motion, or an extent, is seen whole.
   * `colours` maps ink, paper, grid, accent, reference, effort, stop, good, bad to colours. The
   * view has its `scale` (px/m), the height of the legend's `strip` and the width of link 1, `bar`
   * (px), and what the largest arc and arrows stand for: `torque` (N.m), `force`, `contact` (N).
   */
  function fit(source, width, height, colours) {
    const seen = 'arm' in source ? extent(source) : source;
    const wide = Math.max(seen.right - seen.left, 1e-3), high = Math.max(seen.top - seen.bottom, 1e-3);
    const pad = margin(width);
    const view = {
      ...seen, width, height, colours,
      torque: round(seen.torque), force: round(seen.force), contact: round(seen.contact),
      centre: [(seen.left + seen.right) / 2, (seen.bottom + seen.top) / 2],
      strip: 0, scale: 1,
    };
    // the rows of the legend depend on its bar's length, this on the scale, and this on the rows
    for (let pass = 0; pass < 2; pass++) {
      const room = height - view.strip;
      view.scale = Math.min((width - 2 * pad) / wide, Math.max(room - 2 * pad, 1) / high);
      view.length = round(36 / view.scale);
      view.entries = Legend.placed(view);
      view.strip = Legend.height(view.entries);
    }
    view.bar = Math.max(7, Math.min(18, 0.023 * view.scale * Math.hypot(wide, high)));
    return view;
  }

  /** Height in px that suits an extent on a canvas of this width. */
  function height(seen, width) {
    const pad = margin(width), scale = (width - 2 * pad) / Math.max(seen.right - seen.left, 1e-3);
    const wanted = scale * (seen.top - seen.bottom) + 2 * pad + 2 * Legend.ROW;
    return Math.round(Math.max(260, Math.min(wanted, 560, 1.1 * width)));
  }

  /** Place of a point (m) on the canvas (px), and back. */
  function toPixel(view, [x, y]) {
    const middle = (view.height - view.strip) / 2;
    return [(x - view.centre[0]) * view.scale + view.width / 2,
      (view.centre[1] - y) * view.scale + middle];
  }

  function toMetres(view, [x, y]) {
    const middle = (view.height - view.strip) / 2;
    return [(x - view.width / 2) / view.scale + view.centre[0],
      view.centre[1] - (y - middle) / view.scale];
  }

  // ---- drawing

  /** Lines at round distances, so that lengths can be read. */
  function drawGrid(context, view) {
    const step = round(56 / view.scale);
    const [left, top] = toMetres(view, [0, 0]);
    const [right, bottom] = toMetres(view, [view.width, view.height - view.strip]);
    for (let i = Math.ceil(left / step); i * step <= right; i++) {
      const [x] = toPixel(view, [i * step, 0]);
      Shapes.line(context, [[x, 0], [x, view.height - view.strip]], view.colours.grid, 1);
    }
    for (let i = Math.ceil(bottom / step); i * step <= top; i++) {
      const [, y] = toPixel(view, [0, i * step]);
      Shapes.line(context, [[0, y], [view.width, y]], view.colours.grid, 1);
    }
  }

  /** Surface of the wall with hatches behind it. */
  function drawWall(context, view, wall) {
    const normal = [Math.cos(wall.angle), Math.sin(wall.angle)];
    const [x, y] = toPixel(view, normal.map(component => component * wall.position));
    const far = view.width + view.height, {stop} = view.colours;
    context.save();
    context.translate(x, y);
    context.rotate(-wall.angle);
    context.globalAlpha = 0.12;
    context.fillStyle = stop;
    context.fillRect(-14, -far, 14, 2 * far);
    context.globalAlpha = 1;
    for (let at = -far; at < far; at += 10) {
      Shapes.line(context, [[0, at], [-14, at + 10]], stop, 1, 0.55);
    }
    Shapes.line(context, [[0, -far], [0, far]], stop, 2.5);
    context.restore();
  }

  /** Path of the end effector so far; its newest part is the strongest. */
  function drawTrace(context, view, trace) {
    if (trace.length < 2) return;
    const points = trace.map(point => toPixel(view, point));
    Shapes.line(context, points, view.colours.good, 1.6, 0.7);
    Shapes.line(context, points.slice(-Math.ceil(points.length / 8) - 1), view.colours.good, 2.6);
  }

  /** Bearing of joint 1 on the ground. */
  function drawGround(context, view) {
    const [x, y] = toPixel(view, [0, 0]), size = 2 * view.bar, {ink} = view.colours;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x - size * 0.62, y + size);
    context.lineTo(x + size * 0.62, y + size);
    context.closePath();
    Shapes.tinted(context, view.colours, ink, ink, 0.06);
    Shapes.line(context, [[x - size, y + size], [x + size, y + size]], ink, 1.5);
    for (let i = -2; i <= 2; i++) {
      const at = x + i * 0.42 * size;
      Shapes.line(context, [[at, y + size], [at - 6, y + size + 7]], ink, 1);
    }
  }

  /** Stops of joint 1: a block at each limit that the long side of link 1 strikes. */
  function drawStops1(context, view, scene) {
    const limits = scene.arm.stops?.q1;
    if (!limits) return;
    const at = stopOf(limits, scene.q1), radius = 0.42 * scene.arm.l1 * view.scale, {bar} = view;
    [-1, 1].forEach((side, i) => {
      context.save();
      context.translate(...toPixel(view, [0, 0]));
      context.rotate(-limits[i]);
      Shapes.line(context, [[0, 0], [radius, 0]], view.colours.stop, 1.2, 1, [5, 4]);
      const beside = side > 0 ? -1.5 * bar : 0.5 * bar;
      Shapes.box(context, radius - bar / 2, beside, bar, bar);
      Shapes.tinted(context, view.colours, view.colours.stop, undefined, at === side ? 1 : 0.25);
      context.restore();
    });
  }

  /** Turns to link 1: x along z1, y against x1, in px, from the axis of joint 1. */
  function onLink1(context, view, q1, draw) {
    context.save();
    context.translate(...toPixel(view, [0, 0]));
    context.rotate(-q1);
    draw();
    context.restore();
  }

  /** Ends of link 2 and places of its collars, in px from the end effector along z2. */
  function rod(view, arm, q2) {
    const half = 1.15 * view.bar, over = half + 0.7 * view.bar, thick = 0.6 * view.bar;
    const limits = arm.stops?.q2;
    const [low, high] = limits ?? view.slide ?? [0, arm.l1];
    const collars = limits && {
      lower: half - limits[0] * view.scale,
      upper: -half - limits[1] * view.scale - thick,
    };
    const back = collars ? collars.upper : -Math.max(high, q2) * view.scale - over;
    const front = collars ? collars.lower + thick : over - Math.min(low, q2) * view.scale;
    const least = 0.5 * view.bar; // so that the end effector is on it
    return {half, thick, collars, back: Math.min(back, -least), front: Math.max(front, least)};
  }

  /** The reference as an outline: a rim around the arm where both agree. */
  function drawGhost(context, view, {arm, ghost}) {
    const {reference, paper} = view.colours, {bar, scale} = view;
    const across = -arm.a * scale, sleeve = arm.l1 * scale, end = (arm.l1 + ghost.q2) * scale;
    const link1 = [[0, 0], [sleeve, 0], [sleeve, across]], link2 = [[sleeve, across], [end, across]];
    onLink1(context, view, ghost.q1, () => {
      for (const [colour, wider] of [[reference, 9], [paper, 5]]) {
        Shapes.line(context, link1, colour, bar + wider);
        Shapes.line(context, link2, colour, 0.64 * bar + wider);
      }
    });
  }

  /** End effector of the reference, over the arm. */
  function drawTarget(context, view, {arm, ghost}) {
    const {endEffector} = forward(arm, ghost.q1, ghost.q2);
    Shapes.disc(context, ...toPixel(view, endEffector), 0.62 * view.bar + 4);
    context.strokeStyle = view.colours.reference;
    context.lineWidth = 2;
    context.stroke();
  }

  function drawLink1(context, view, arm) {
    const {bar, scale} = view, {ink, paper, accent} = view.colours;
    const bent = [[0, 0], [arm.l1 * scale, 0], [arm.l1 * scale, -arm.a * scale]];
    Shapes.line(context, bent, ink, bar + 3);
    Shapes.line(context, bent, paper, bar);
    Shapes.line(context, bent, accent, bar, 0.3);
    if (arm.lc1 != null) Shapes.centreOfMass(context, view.colours, arm.lc1 * scale, 0, 0.55 * bar);
  }

  function drawLink2(context, view, {arm, q2}) {
    const {bar, scale} = view, {ink, effort} = view.colours;
    const {half, thick, collars, back, front} = rod(view, arm, q2);
    const end = (arm.l1 + q2) * scale, across = -arm.a * scale, at = stopOf(arm.stops?.q2, q2);
    Shapes.box(context, end + back, across - 0.32 * bar, front - back, 0.64 * bar);
    Shapes.tinted(context, view.colours, effort, ink, 0.35);
    Shapes.box(context, arm.l1 * scale - half, across - 0.75 * bar, 2 * half, 1.5 * bar, 4);
    context.save();
    context.globalAlpha = 0.88;
    Shapes.tinted(context, view.colours, view.colours.accent, ink, 0.3);
    context.restore();
    for (const [place, side] of collars ? [[collars.lower, -1], [collars.upper, 1]] : []) {
      Shapes.box(context, end + place, across - bar, thick, 2 * bar);
      Shapes.tinted(context, view.colours, view.colours.stop, undefined, at === side ? 1 : 0.25);
    }
  }

  function drawPayload(context, view, {arm, q2}) {
    const {bar, scale} = view, size = 2.6 * bar;
    const x = (arm.l1 + q2 + arm.payload.z) * scale, y = -(arm.a + arm.payload.x) * scale;
    Shapes.box(context, x - size / 2, y - size / 2, size, size, 3);
    context.save();
    context.globalAlpha = 0.85;
    Shapes.tinted(context, view.colours, view.colours.good, undefined, 0.35);
    context.restore();
    Shapes.centreOfMass(context, view.colours, x, y, 0.5 * bar);
  }

  /** The payload where it lies until the arm grasps it. */
  function drawWaiting(context, view, {arm, payload_waits: {q1, q2}}) {
    onLink1(context, view, q1, () => drawPayload(context, view, {arm, q2}));
  }

  /** End effector, which is the centre of mass of link 2. */
  function drawEndEffector(context, view, {arm, q2}) {
    const x = (arm.l1 + q2) * view.scale, y = -arm.a * view.scale;
    Shapes.centreOfMass(context, view.colours, x, y, 0.62 * view.bar);
    Shapes.disc(context, x, y, 0.62 * view.bar);
    context.strokeStyle = view.colours.good;
    context.lineWidth = 2.4;
    context.stroke();
  }

  function drawArm(context, view, scene) {
    onLink1(context, view, scene.q1, () => {
      drawLink1(context, view, scene.arm);
      drawLink2(context, view, scene);
      if (scene.payload_attached && scene.arm.payload) drawPayload(context, view, scene);
      drawEndEffector(context, view, scene);
    });
    Shapes.disc(context, ...toPixel(view, [0, 0]), 0.7 * view.bar);
    Shapes.tinted(context, view.colours, view.colours.ink, undefined, 0);
  }

  /** Efforts of the drives and the force on the tip: lengths and angles grow with them. */
  function drawEfforts(context, view, scene) {
    const {effort, bad} = view.colours, {arm, q1, q2} = scene, {bar, scale} = view;
    if (view.torque && scene.tau1) {
      const [x, y] = toPixel(view, [0, 0]);
      // a view that was not made for the torque may be too small for it
      const sweep = Math.max(-TURN, Math.min(TURN, scene.tau1 / view.torque * WIDEST));
      Shapes.arcArrow(context, x, y, 2.6 * bar, q1 + Math.sign(sweep) * 0.35, sweep, effort);
    }
    if (view.force && scene.f2) {
      onLink1(context, view, q1, () => {
        const beside = -arm.a * scale - (arm.a < 0 ? -1.7 : 1.7) * bar;
        Shapes.arrow(context, arm.l1 * scale, beside, scene.f2 / view.force * LONGEST, 0, effort);
      });
    }
    const fx = scene.ee_fx ?? 0, fy = scene.ee_fy ?? 0;
    if (view.contact && (fx || fy)) {
      const [x, y] = toPixel(view, forward(arm, q1, q2).tip);
      const length = Math.hypot(fx, fy) / view.contact * LONGEST;
      Shapes.arrow(context, x, y, length, -Math.atan2(fy, fx), bad, 3.4);
    }
  }

  /** What friction does to the joints. */
  function drawModes(context, view, {arm, q1, mode1, mode2}) {
    const [x, y] = toPixel(view, [0, 0]), {bar, scale} = view;
    if (mode1 === HELD) Shapes.padlock(context, view.colours, x, y);
    if (Math.abs(mode1) === 1) {
      const angle = q1 + mode1 * 0.9, radius = 1.7 * bar;
      Shapes.chevrons(context, view.colours, x + radius * Math.cos(angle),
        y - radius * Math.sin(angle), -angle - mode1 * Math.PI / 2);
    }
    const side = arm.a < 0 ? -1 : 1;
    const [u, v] = [arm.l1 + 1.5 * bar / scale, arm.a - side * 1.8 * bar / scale];
    const place = toPixel(view,
      [u * Math.cos(q1) - v * Math.sin(q1), u * Math.sin(q1) + v * Math.cos(q1)]);
    if (mode2 === HELD) Shapes.padlock(context, view.colours, ...place);
    if (Math.abs(mode2) === 1) {
      Shapes.chevrons(context, view.colours, ...place, mode2 > 0 ? -q1 : Math.PI - q1);
    }
  }

  /** Draws a scene on a cleared canvas whose transformation takes px of CSS. */
  function draw(context, view, scene) {
    context.save();
    context.fillStyle = view.colours.paper;
    context.fillRect(0, 0, view.width, view.height);
    context.save();
    context.beginPath();
    context.rect(0, 0, view.width, view.height - view.strip);
    context.clip();
    drawGrid(context, view);
    if (scene.arm.wall) drawWall(context, view, scene.arm.wall);
    drawTrace(context, view, scene.trace ?? []);
    drawStops1(context, view, scene);
    drawGround(context, view);
    if (scene.ghost) drawGhost(context, view, scene);
    if (scene.payload_waits) drawWaiting(context, view, scene);
    drawArm(context, view, scene);
    if (scene.ghost) drawTarget(context, view, scene);
    drawEfforts(context, view, scene);
    drawModes(context, view, scene);
    context.restore();
    Legend.draw(context, view);
    context.restore();
  }

  return {HELD, FREE, forward, stopOf, extent, fit, height, toPixel, toMetres, draw};
})();
