// What tests of tests/animation/test_arm_drawing.py run in the page of a player.

const {toPixel} = Arm;

/** Colours of names. */
function named(...names) {
  return names.map(name => parsed(player.view.colours[name]));
}

/** Colour at a point in m. */
function at(point) {
  return colourAt(toPixel(player.view, point));
}

/** Pixels of a colour in a box, in px of CSS: how many, and from where to where. */
function pixels(name, left, top, right, bottom) {
  const [colour] = named(name);
  const found = {count: 0, left: Infinity, right: -Infinity};
  for (let y = top; y <= bottom; y++) for (let x = left; x <= right; x++) {
    const here = colourAt([x, y]);
    if (here.some((channel, i) => Math.abs(channel - colour[i]) > 12)) continue;
    found.count += 1;
    found.left = Math.min(found.left, x);
    found.right = Math.max(found.right, x);
  }
  return found;
}
/** Colours around a point in m, the colour of an end effector, and the place in px. */
function ring(point) {
  const [x, y] = toPixel(player.view, point), radius = 0.62 * player.view.bar;
  const around = [...Array(8).keys()].map(i => i * Math.PI / 4);
  return [around.map(angle => colourAt([x + radius * Math.cos(angle), y + radius * Math.sin(angle)])),
    ...named('good'), [x, y]];
}
/** Colours on link 1, three, and on link 2. */
function onLinks(shown) {
  player.show(shown);
  const {arm, q1, q2} = player.motion, {row} = player;
  const {elbow, sleeve, endEffector} = Arm.forward(arm, q1[row], q2[row]);
  const between = (one, other, part) => one.map((x, i) => x + part * (other[i] - x));
  return [between([0, 0], elbow, 0.3), between([0, 0], elbow, 0.8),
    between(elbow, sleeve, 0.4), between(sleeve, endEffector, 0.6)].map(at);
}
/** Where the sleeve is and where the arrow of the force begins, px, and the width of link 1. */
function sleeve() {
  const [x, y] = toPixel(player.view, [0.5, 0.1]), {bar} = player.view;
  return [Math.round(x), y - 2.3 * bar, bar];
}
/** Colour on the arc of a torque. */
function onArc(angle) {
  const [x, y] = toPixel(player.view, [0, 0]), radius = 2.6 * player.view.bar;
  return colourAt([x + radius * Math.cos(angle), y - radius * Math.sin(angle)]);
}
/** Colours along a force of (3, 4) on the tip. */
function fromTip(row) {
  player.show(row);
  const [x, y] = toPixel(player.view, player.path[0]);
  return [20, 40, 60].map(r => colourAt([x + 0.6 * r, y - 0.8 * r]));
}
/** Colours at the middles of the collars, half of their height off the axis of link 2. */
function collars(row, q2) {
  player.show(row);
  const {scale, bar} = player.view, [x, y] = toPixel(player.view, [0.5 + q2, 0.1]);
  return [1.15 * bar + 0.1 * scale + 0.3 * bar, -1.15 * bar - 0.2 * scale - 0.3 * bar]
    .map(along => colourAt([x + along, y - 0.5 * bar]));
}
/** Colours at the middle of each block: its half, and link 1 beyond the limit. */
function blocks(row, limits) {
  player.show(row);
  const {scale, bar} = player.view, [x, y] = toPixel(player.view, [0, 0]);
  const radius = 0.42 * 0.5 * scale;
  return limits.map((limit, i) => {
    const beyond = i ? bar : -bar, s = Math.sin(limit), c = Math.cos(limit);
    return colourAt([x + radius * c - beyond * s, y - radius * s - beyond * c]);
  });
}
/** How many pixels the marks at joint 1 have. */
function marks(row) {
  player.show(row);
  const [x, y] = toPixel(player.view, [0, 0]), size = 2.4 * player.view.bar;
  return pixels('accent', ...[x - size, y - size, x + size, y + size].map(Math.round)).count;
}
/** Colour in the corner of the payload. */
function payload(row) {
  player.show(row);
  const [x, y] = toPixel(player.view, [0.8, 0.2]), {bar} = player.view;
  return colourAt([x + bar, y + bar]);
}
/** Colour beside the middle of the reference's link 1, and the colour of references. */
function outline() {
  const [x, y] = toPixel(player.view, [0.25 * Math.cos(0.4), 0.25 * Math.sin(0.4)]);
  const beside = player.view.bar / 2 + 3.5;
  return [colourAt([x - beside * Math.sin(0.4), y - beside * Math.cos(0.4)]), ...named('reference')];
}
