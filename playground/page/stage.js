'use strict';

/** The drawing of the arm: the hand that pulls at it, its path, and the colours of the page. */
class Stage {
  static PUSH = 20; // N, of an arrow key
  static GROWS = 0.3; // of the length of link 1, by which the view grows
  static PATH = 300; // points
  static GRIP = 70; // px from the end effector within which it can be taken
  static SLIDE = [-0.5, 0.5]; // m, least range in view where joint 2 has no stops
  static KEYS = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};

  /** @param {HTMLCanvasElement} canvas @param {Simulation} simulation */
  constructor(canvas, simulation) {
    this.canvas = canvas;
    this.simulation = simulation;
    this.path = [];
    /** What the arm has covered, m. @type {?{left: number, right: number, bottom: number, top: number}} */
    this.box = null;
    this.pressed = new Set();
    /** Where a pointer holds the end effector, px. @type {?[number, number]} */
    this.held = null;
    this.colours = Stage.readColours();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.fit());
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.#listenToPointer();
    this.#listenToKeys();
    this.fit();
  }

  static readColours() {
    const style = getComputedStyle(document.documentElement);
    const names = ['ink', 'paper', 'grid', 'accent', 'reference', 'effort', 'stop', 'good', 'bad'];
    return Object.fromEntries(names.map(name => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  // ---- drawing

  /** Geometry of the arm by the plant's parameters, as Arm takes it. */
  arm() {
    const plant = this.simulation.fmus.plant;
    const value = name => plant.get(name);
    const stops = i => (value(`stops${i}`) === 1 ? null : [value(`lower${i}`), value(`upper${i}`)]);
    return {
      a: value('a'), l1: value('l1'), lc1: value('lc1'), g: value('g'),
      stops: {q1: stops(1), q2: stops(2)}, wall: null,
      payload: {x: value('payload_x'), z: value('payload_z')},
    };
  }

  /** Take over the size of the canvas, the colours and the parameters. */
  fit() {
    if (!this.canvas.clientWidth) return; // not in view
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    this.colours = Stage.readColours();
    this.geometry = this.arm();
    if (!this.path.length) this.box = null; // another motion begins
    this.#cover();
    this.#choose();
    this.draw();
  }

  /** Widen the box, m, that the arm has covered since its path began; whether it grew. */
  #cover() {
    const {l1, stops} = this.geometry;
    const [low, high] = stops.q2 ?? Stage.SLIDE;
    const [q1, q2] = this.simulation.motion.get();
    const {elbow, sleeve, endEffector} = Arm.forward(this.geometry, q1, q2);
    // link 2 is so long that it is in its sleeve wherever it is: it ends `low` before the end
    // effector and `high` behind it
    const ends = [low, high].map(end => Arm.forward(this.geometry, q1, q2 - end).endEffector);
    const points = [elbow, sleeve, endEffector, ...ends];
    const step = Stage.GROWS * Math.max(l1, 0.1), before = this.box;
    const beyond = (axis, sign) => {
      const far = sign * Math.max(...points.map(point => sign * point[axis]), step);
      return sign * Math.ceil(sign * far / step) * step;
    };
    const now = {
      left: beyond(0, -1), right: beyond(0, 1), bottom: beyond(1, -1), top: beyond(1, 1),
    };
    this.box = before === null ? now : {
      left: Math.min(before.left, now.left), right: Math.max(before.right, now.right),
      bottom: Math.min(before.bottom, now.bottom), top: Math.max(before.top, now.top),
    };
    return before === null || Object.keys(now).some(side => this.box[side] !== before[side]);
  }

  /** Choose the view of the box; the point under the pointer stays there. */
  #choose() {
    const {g, stops} = this.geometry;
    this.view = Arm.fit({
      ...this.box, slide: stops.q2 ?? Stage.SLIDE,
      torque: 40, force: 80, contact: 80, gravity: g, ghost: this.simulation.isControlled, modes: true,
      stops: stops.q1 !== null || stops.q2 !== null, trace: true,
    }, this.canvas.clientWidth, this.canvas.clientHeight, this.colours);
    if (this.held) this.#pull();
  }

  scene() {
    const {simulation, geometry} = this;
    const {plant} = simulation.fmus;
    const [q1, q2] = simulation.motion.get();
    const [tau1, f2, ee_fx, ee_fy] = simulation.inputs.get();
    const [g1, g2] = simulation.reference;
    return {
      arm: geometry, q1, q2, tau1, f2, ee_fx, ee_fy,
      ghost: simulation.isControlled ? {q1: g1, q2: g2} : null,
      payload_attached: plant.get('payload_attached') === 1,
      mode1: plant.get('mode1'), mode2: plant.get('mode2'), trace: this.path,
    };
  }

  /** Remember where the end effector is. */
  follow() {
    const [x, y] = this.simulation.tip.get();
    this.path.push([x, y]);
    if (this.path.length > Stage.PATH) this.path.shift();
  }

  /** The arm as it is now; where it leaves the view, this follows. */
  draw() {
    if (!this.canvas.clientWidth) return;
    if (this.#cover()) this.#choose();
    const context = this.canvas.getContext('2d');
    const ratio = window.devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, this.view.width, this.view.height);
    Arm.draw(context, this.view, this.scene());
    const {target} = this.simulation.hand;
    if (target) this.#drawHand(context, target);
  }

  #drawHand(context, target) {
    const [x, y] = this.simulation.tip.get();
    context.strokeStyle = this.colours.accent;
    context.lineWidth = 1.5;
    context.setLineDash([5, 4]);
    context.beginPath();
    context.moveTo(...Arm.toPixel(this.view, [x, y]));
    context.lineTo(...Arm.toPixel(this.view, target));
    context.stroke();
    context.setLineDash([]);
  }

  // ---- the hand

  /** Place of a pointer. @returns {[number, number]} px on the canvas */
  #place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** Whether the end effector can be taken there. @param {[number, number]} place px */
  #isInReach([x, y]) {
    const tip = this.simulation.tip.get();
    const [tipX, tipY] = Arm.toPixel(this.view, [tip[0], tip[1]]);
    return Math.hypot(x - tipX, y - tipY) <= Stage.GRIP;
  }

  #pull() {
    this.simulation.hand.target = Arm.toMetres(this.view, this.held);
  }

  #listenToPointer() {
    const {canvas, simulation} = this;
    const pull = event => {
      this.held = this.#place(event);
      this.#pull();
    };
    canvas.addEventListener('pointerdown', event => {
      if (!this.#isInReach(this.#place(event))) return;
      canvas.setPointerCapture(event.pointerId);
      pull(event);
    });
    canvas.addEventListener('pointermove', event => {
      if (canvas.hasPointerCapture(event.pointerId)) pull(event);
    });
    canvas.addEventListener('lostpointercapture', () => {
      this.held = null;
      simulation.hand.target = null;
    });
    // a finger that starts elsewhere scrolls the page
    canvas.addEventListener('touchstart', event => {
      if (this.#isInReach(this.#place(event.touches[0]))) event.preventDefault();
    }, {passive: false});
  }

  #listenToKeys() {
    const push = () => {
      const sums = [0, 1].map(axis =>
        [...this.pressed].reduce((sum, key) => sum + Stage.KEYS[key][axis], 0));
      this.simulation.hand.push = sums.map(sum => Stage.PUSH * sum);
    };
    this.canvas.addEventListener('keydown', event => {
      if (!(event.key in Stage.KEYS)) return;
      event.preventDefault();
      this.pressed.add(event.key);
      push();
    });
    this.canvas.addEventListener('keyup', event => {
      this.pressed.delete(event.key);
      push();
    });
    this.canvas.addEventListener('blur', () => {
      this.pressed.clear();
      push();
    });
  }
}
