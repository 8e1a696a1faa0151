'use strict';

/**
 * Plays a motion of the arm in an element of the page; load shapes.js, legend.js and arm.js before.
 *
 * What is drawn is always a recorded row, never a value between two. When another row is shown, the
 * element gets the event "time", whose detail is {time, row}: time in s.
 */
class Player {
  static SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
  static POINTS = 1000; // of the path that is drawn
  static CALM = 0.5; // s between pictures where the user wants less motion
  static COLOURS = ['ink', 'paper', 'grid', 'accent', 'reference', 'effort', 'stop', 'good', 'bad'];

  /** `motion` is what rparm/report/motion.py writes: a list of one value a row for each name. */
  constructor(element, motion) {
    this.element = element;
    this.motion = motion;
    this.extent = Arm.extent(motion);
    // Array.from: columns may be typed arrays
    this.path = Array.from(motion.q1,
      (q1, row) => Arm.forward(motion.arm, q1, motion.q2[row]).endEffector);
    this.grasp = motion.payload_attached?.indexOf(true) ?? -1;
    this.row = -1;
    this.speed = 1;
    this.playing = false;
    this.calm = matchMedia('(prefers-reduced-motion: reduce)');
    this.dark = matchMedia('(prefers-color-scheme: dark)');
    this.#build();
    this.#listen();
    this.#resize();
    this.show(0);
  }

  /** Time of the row that is shown, s. */
  get time() {
    return this.motion.time[this.row];
  }

  /** What is drawn, as `Arm.draw` takes it: the values of the row. */
  get scene() {
    const {motion, row} = this, {reference} = motion;
    const scene = {
      arm: motion.arm,
      ghost: reference && {q1: reference.q1[row], q2: reference.q2[row]},
      payload_waits: motion.arm.payload?.at_rest && row < this.grasp
        ? {q1: motion.q1[this.grasp], q2: motion.q2[this.grasp]} : null,
      trace: this.#trace(row),
    };
    for (const name of ['q1', 'q2', 'tau1', 'f2', 'ee_fx', 'ee_fy', 'payload_attached', 'mode1',
      'mode2']) {
      scene[name] = motion[name]?.[row] ?? null;
    }
    return scene;
  }

  /** Path until a row: its points, but not more than are seen. */
  #trace(row) {
    const every = Math.ceil(this.path.length / Player.POINTS);
    const found = this.path.slice(0, row + 1);
    return every === 1 ? found : found.filter((_, i) => i % every === 0 || i === row);
  }

  /** Shows the row whose time is the nearest to `time` (s). */
  seek(time) {
    this.show(this.#nearest(time));
    this.clock = this.time;
  }

  /** Shows a row, the first or the last one if there is none of this number. */
  show(row) {
    const shown = Math.max(0, Math.min(this.motion.time.length - 1, row));
    if (shown === this.row) return;
    this.row = shown;
    this.draw();
    this.#say();
    const detail = {time: this.time, row: shown};
    this.element.dispatchEvent(new CustomEvent('time', {detail}));
  }

  /** Goes on from the row that is shown; from the first one at the end. */
  play() {
    if (this.playing) return;
    if (this.row === this.motion.time.length - 1) this.show(0);
    this.playing = true;
    this.clock = this.time;
    this.last = null;
    this.#label();
    requestAnimationFrame(now => this.#frame(now));
  }

  pause() {
    this.playing = false;
    this.#label();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  /** Draws the row that is shown again, for a page that has changed its colours or its size. */
  draw() {
    if (!this.view) return; // the element is hidden and has no width
    const ratio = window.devicePixelRatio || 1, {width, height} = this.view;
    const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== wide) this.canvas.width = wide;
    if (this.canvas.height !== high) this.canvas.height = high;
    const context = this.canvas.getContext('2d');
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    Arm.draw(context, this.view, this.scene);
  }

  // ---- time

  #frame(now) {
    if (!this.playing) return;
    // a page in the background gets no frames: resume there
    const elapsed = this.last === null ? 0 : Math.min((now - this.last) / 1000, 1);
    if (this.last === null || !this.calm.matches || elapsed >= Player.CALM) {
      this.last = now;
      this.clock += elapsed * this.speed;
      this.show(this.#nearest(this.clock));
    }
    if (this.clock >= this.motion.time.at(-1)) this.pause();
    else requestAnimationFrame(later => this.#frame(later));
  }

  /** Row whose time is the nearest, by bisection. */
  #nearest(time) {
    const times = this.motion.time;
    let low = 0, high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle;
      else high = middle;
    }
    return time - times[low] <= times[high] - time ? low : high;
  }

  // ---- page

  #build() {
    const last = this.motion.time.length - 1;
    this.element.classList.add('player');
    this.element.innerHTML = `
      <canvas role="img"></canvas>
      <div class="player-controls" role="group" aria-label="Animation">
        <button type="button" class="player-toggle"></button>
        <input type="range" class="player-time" aria-label="Time" min="0" max="${last}" step="1"
          value="0">
        <span class="player-clock" aria-hidden="true"></span>
        <label class="player-speed"><span>Speed</span>
          <select>${Player.SPEEDS.map(x => `<option value="${x}">${x} ×</option>`).join('')}</select>
        </label>
      </div>
      <ul class="player-values"></ul>
      <details class="player-keys"><summary>Keys</summary>While a control of the player has the focus:
        <kbd>Space</kbd> plays and pauses, <kbd>←</kbd> <kbd>→</kbd> go
        by a row, with <kbd>Shift</kbd> by twenty, <kbd>Home</kbd> <kbd>End</kbd> to the ends.</details>`;
    const found = name => this.element.querySelector(name);
    this.canvas = found('canvas');
    this.button = found('.player-toggle');
    this.slider = found('.player-time');
    this.clockText = found('.player-clock');
    this.select = found('select');
    this.select.value = String(this.speed);
    this.controls = found('.player-controls');
    this.list = found('.player-values');
    this.values = this.#values(this.list);
    this.#label();
  }

  /** Makes the list of values: [element of the value, its text for a scene]. */
  #values(list) {
    const number = (x, unit) => `${Player.number(x)} ${unit}`;
    const texts = [
      ['q1', 'q₁', x => number(x, 'rad')], ['q2', 'q₂', x => number(x, 'm')],
      ['tau1', 'τ₁', x => number(x, 'N·m')], ['f2', 'f₂', x => number(x, 'N')],
      ['ee_fx', 'tip force x', x => number(x, 'N')], ['ee_fy', 'tip force y', x => number(x, 'N')],
      ['mode1', 'joint 1', (mode, scene) => Player.state(mode, scene.arm.stops?.q1, scene.q1)],
      ['mode2', 'joint 2', (mode, scene) => Player.state(mode, scene.arm.stops?.q2, scene.q2)],
      ['payload_attached', 'payload', attached => (attached ? 'attached' : 'not attached')],
    ];
    return texts.filter(([name]) => this.#shows(name)).map(([name, label, text]) => {
      const item = document.createElement('li');
      item.dataset.name = name;
      item.innerHTML = `<b>${label}</b> <span></span>`;
      item.classList.toggle('player-words', name.startsWith('mode'));
      list.append(item);
      return [item.lastElementChild, scene => text(scene[name], scene)];
    });
  }

  /** Whether a column is there and, of modes and payload, whether they ever matter. */
  #shows(name) {
    const values = this.motion[name];
    if (name.startsWith('mode')) return values != null && this.extent.modes;
    return values != null && (name !== 'payload_attached' || values.includes(true));
  }

  #listen() {
    this.button.addEventListener('click', () => this.toggle());
    this.canvas.addEventListener('click', () => this.toggle());
    this.slider.addEventListener('input', () => {
      this.show(Number(this.slider.value));
      this.clock = this.time;
    });
    this.select.addEventListener('change', () => { this.speed = Number(this.select.value); });
    this.controls.addEventListener('keydown', event => this.#key(event));
    this.dark.addEventListener('change', () => this.#resize());
    new ResizeObserver(() => this.#resize()).observe(this.element);
  }

  #key(event) {
    if (event.target === this.select || event.ctrlKey || event.altKey || event.metaKey) return;
    const rows = event.shiftKey ? 20 : 1;
    const actions = {
      ' ': () => this.toggle(),
      ArrowLeft: () => this.show(this.row - rows),
      ArrowRight: () => this.show(this.row + rows),
      Home: () => this.show(0),
      End: () => this.show(this.motion.time.length - 1),
    };
    if (!(event.key in actions)) return;
    event.preventDefault(); // else the slider would step once more, and the page would scroll
    actions[event.key]();
    this.clock = this.time;
  }

  /** Fits the drawing to the element's width and takes the colours of the page. */
  #resize() {
    const width = this.element.clientWidth;
    if (!width) return;
    const style = getComputedStyle(this.element);
    const colours = Object.fromEntries(
      Player.COLOURS.map(name => [name, style.getPropertyValue(`--${name}`).trim()]));
    const height = Arm.height(this.extent, width);
    this.view = Arm.fit({...this.extent}, width, height, colours);
    this.canvas.style.height = `${height}px`;
    if (this.row >= 0) this.draw();
  }

  #label() {
    const [label, icon] = this.playing ? ['Pause', 'M3 2h4v12H3zM9 2h4v12H9z']
      : ['Play', 'M3 1.5v13l11-6.5z'];
    this.button.setAttribute('aria-label', label);
    this.button.innerHTML =
      `<svg viewBox="0 0 16 16" aria-hidden="true"><path d="${icon}" fill="currentColor"/></svg>`;
  }

  /** Texts of the row, for those who see the page and those who hear it. */
  #say() {
    const {scene} = this, time = `${this.time.toFixed(3)} s`;
    this.slider.value = String(this.row);
    this.slider.setAttribute('aria-valuetext', time);
    this.clockText.textContent = time;
    for (const [place, text] of this.values) place.textContent = text(scene);
    const pose = `q1 = ${Player.number(scene.q1)} rad, q2 = ${Player.number(scene.q2)} m`;
    this.canvas.setAttribute('aria-label', `The arm at ${time}: ${pose}`);
  }

  /** A value with five digits, four of them decimals at most. */
  static number(x) {
    const size = Math.abs(x);
    if (size < 5e-5) return '0.0000';
    const digits = Math.min(4, 4 - Math.floor(Math.log10(size)));
    const text = digits < 0 ? x.toExponential(3) : x.toFixed(digits);
    return text.replace(/-/g, '\u2212');
  }

  /** A mode of friction in words. */
  static state(mode, limits, q) {
    const words = {'-1': 'slides backward', 0: 'held', 1: 'slides forward', 2: 'free'};
    const at = {'-1': ', at lower stop', 0: '', 1: ', at upper stop'};
    return (words[mode] ?? '') + at[Arm.stopOf(limits, q)];
  }
}
