'use strict';

/** An FMU that cannot be shown; the message says why. */
class UnsuitedError extends Error {}

/** Files of a ZIP archive that is given as bytes. */
class Archive {
  static END = 0x06054b50; // signature of its last record
  static LARGEST = 50e6; // bytes of a file

  /** @param {ArrayBuffer} buffer */
  constructor(buffer) {
    this.view = new DataView(buffer);
    this.entries = new Map();
    let end = buffer.byteLength - 22;
    while (end >= 0 && this.view.getUint32(end, true) !== Archive.END) end--;
    if (end < 0) throw new UnsuitedError('is no ZIP archive, as an FMU is');
    let at = this.view.getUint32(end + 16, true);
    for (let count = this.view.getUint16(end + 10, true); count > 0; count--) {
      const [name, extra, comment] = [28, 30, 32].map(place => this.view.getUint16(at + place, true));
      const text = new TextDecoder().decode(new Uint8Array(buffer, at + 46, name));
      this.entries.set(text, at);
      at += 46 + name + extra + comment;
    }
  }

  get names() {
    return [...this.entries.keys()];
  }

  /** @returns {Promise<Uint8Array>} */
  async read(name) {
    const {view} = this, at = this.entries.get(name);
    const [packed, size, local] = [20, 24, 42].map(place => view.getUint32(at + place, true));
    if (size > Archive.LARGEST) throw new UnsuitedError(`${name} is too large`);
    const start = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
    const bytes = new Uint8Array(view.buffer, start, packed);
    if (view.getUint16(at + 10, true) === 0) return bytes;
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }
}

/** An FMU that the user brings along: its outputs against time, its inputs and parameters by sliders. */
class Own {
  static FRAME = 0.1; // s of wall time that one frame makes up for at most
  static BUDGET = 25; // ms of computing in one frame
  static LASTS = 10; // s of wall time that its experiment takes at speed 1
  static TOGETHER = 3; // curves of a chart
  static OPEN = 12; // controls of a group that is open at first
  static POINTS = 500; // of a chart

  /** Read the file of an FMU. @param {File} file @returns {Promise<Fmu>} */
  static async load(file) {
    try {
      const archive = new Archive(await file.arrayBuffer());
      const described = 'modelDescription.xml';
      if (!archive.names.includes(described)) throw new UnsuitedError(`has no ${described}`);
      const xml = new TextDecoder().decode(await archive.read(described));
      const description = new ModelDescription(xml);
      if (!['2.0', '3.0'].includes(description.version)) {
        throw new UnsuitedError(`is of FMI ${description.version}: the playground loads FMI 2.0 and 3.0`);
      }
      const module = archive.names.find(name => /^binaries\/wasm32-wasi\/.*\.wasm$/.test(name));
      if (!module) throw new UnsuitedError('has no WebAssembly: rparm build --web makes an FMU with it');
      return await Fmu.load(await archive.read(module), description);
    } catch (error) {
      const isDamage = error instanceof TypeError || error instanceof RangeError
        || error instanceof WebAssembly.CompileError || error instanceof WebAssembly.LinkError;
      if (isDamage) throw new UnsuitedError(`is damaged: ${error.message}`);
      throw error;
    }
  }

  /** @param {HTMLElement} element @param {Fmu} fmu @param {(text: string) => void} say */
  constructor(element, fmu, say) {
    this.element = element;
    this.fmu = fmu;
    this.say = say;
    this.variables = [...fmu.description.variables.values()];
    for (const variable of this.variables) {
      if (variable.type === 'Boolean') {
        variable.items = [['false', 0], ['true', 1]].map(
          ([name, value]) => ({name, value, description: ''}));
      }
    }
    const {start, stop, step} = fmu.description.experiment;
    this.begin = start;
    this.span = stop > start ? stop - start : Own.LASTS;
    this.step = step > 0 ? step : this.span / 5000;
    this.values = new Map();
    this.speed = 1;
    this.debt = 0;
    this.isOver = false;
    fmu.onWarning = text => say(text);
    this.#build();
    this.reset();
    this.controls.refresh();
    this.play(!matchMedia('(prefers-reduced-motion: reduce)').matches);
    requestAnimationFrame(now => this.#frame(now, now));
  }

  /** End its loop: another one takes its place. */
  end() {
    this.isOver = true;
  }

  // ---- page

  #build() {
    const {element, fmu} = this, {name, text} = fmu.description;
    const find = part => element.querySelector(part);
    find('h2').textContent = name;
    find('p').textContent = text;
    const [charts, groups, others] = ['.charts', '.groups', '.others'].map(find);
    for (const part of [charts, groups, others]) part.replaceChildren();
    const outputs = this.variables.filter(({causality}) => causality === 'output');
    const reals = outputs.filter(({type}) => type === 'Real');
    const parts = [];
    for (const unit of new Set(reals.map(variable => variable.unit))) {
      const names = reals.filter(variable => variable.unit === unit).map(variable => variable.name);
      while (names.length) parts.push(names.splice(0, Own.TOGETHER));
    }
    this.charts = parts.map(names => new Chart(charts, fmu, names.length > 1 ? '' : names[0], 0, names, this.span));
    this.others = outputs.filter(({type}) => type !== 'Real').map(variable => {
      const row = document.createElement('li'), value = document.createElement('b');
      row.append(`${variable.name} `, value);
      others.append(row);
      return [variable, value];
    });
    this.controls = new Controls({fmus: {own: fmu}}, (_, variable, value) => this.change(variable, value), this.say);
    const isSet = ({causality, initial}) => initial === 'exact' && causality !== 'parameter';
    this.#addGroup(groups, 'Inputs', ({causality}) => causality === 'input');
    this.#addGroup(groups, 'Parameters', ({causality, name: of}) => causality === 'parameter' && !Own.isSolver(of));
    this.#addGroup(groups, 'Initial state', isSet);
    this.#addGroup(groups, 'Solver', ({causality, name: of}) => causality === 'parameter' && Own.isSolver(of));
    const [play, again] = element.querySelectorAll('button');
    play.onclick = () => this.play(!this.isRunning);
    again.onclick = () => this.reset();
    const speed = find('select');
    speed.onchange = () => { this.speed = Number(speed.value); };
    this.speed = Number(speed.value);
    this.playButton = play;
  }

  static isSolver(name) {
    return /^solver_|tolerance$|^max_(step|internal_steps|events)$/.test(name);
  }

  #addGroup(element, title, isIn) {
    const found = this.variables.filter(variable => isIn(variable) && variable.type !== 'String');
    if (!found.length) return;
    const details = document.createElement('details'), summary = document.createElement('summary');
    summary.textContent = title;
    details.append(summary);
    details.open = title !== 'Solver' && found.length <= Own.OPEN;
    for (const variable of found) this.controls.addVariable(details, 'own', variable.name, Own.range(variable));
    element.append(details);
  }

  /** Smallest, largest and step of a slider: as declared, else around the start value. */
  static range({type, causality, start, min, max}) {
    const size = start ? 2 * Math.abs(start) : causality === 'input' ? 10 : 1;
    const isFinite = value => value !== null && Math.abs(value) < 1e9;
    const least = isFinite(min) ? min : Math.min(-size, isFinite(max) ? max - size : 0);
    const most = isFinite(max) ? max : Math.max(size, least + size);
    const step = 10 ** Math.floor(Math.log10((most - least) / 100));
    return [least, most, type === 'Real' ? step : 1];
  }

  // ---- what users do

  play(isRunning) {
    this.isRunning = isRunning;
    this.playButton.textContent = isRunning ? 'Pause' : 'Play';
  }

  /** Start again, with the values that were set. */
  reset() {
    const {fmu} = this;
    this.steps = 0;
    this.debt = 0;
    try {
      fmu.reset();
      fmu.setUp(this.begin);
      for (const [name, value] of this.values) fmu.set(name, value);
      fmu.initialize();
      for (const chart of this.charts) chart.clear();
    } finally {
      this.#show();
    }
  }

  /** An input or a tunable parameter changes now; another variable starts it again. */
  change(variable, value) {
    const before = this.values.get(variable.name);
    this.say('');
    this.values.set(variable.name, value);
    try {
      if (variable.variability === 'fixed' || variable.initial === 'exact' && variable.causality !== 'parameter') this.reset();
      else this.fmu.set(variable.name, value);
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      this.say(`${variable.name} = ${value} is refused: ${error.message}`);
      if (before === undefined) this.values.delete(variable.name);
      else this.values.set(variable.name, before);
      this.reset();
    }
  }

  // ---- running

  get time() {
    return this.begin + this.steps * this.step;
  }

  #frame(now, before) {
    if (this.isOver) return;
    if (this.isRunning) this.#run((now - before) / 1e3);
    requestAnimationFrame(next => this.#frame(next, now));
  }

  #run(passed) {
    const end = performance.now() + Own.BUDGET;
    this.debt += this.speed * this.span / Own.LASTS * Math.min(passed, Own.FRAME);
    try {
      while (this.debt >= this.step && performance.now() < end) {
        this.fmu.doStep(this.time, this.step);
        this.steps++;
        this.debt -= this.step;
        for (const chart of this.charts) chart.add(this.time);
      }
      this.debt = Math.min(this.debt, this.span / Own.POINTS);
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      this.play(false);
      this.say(`It stopped at ${this.time.toPrecision(4)} s: ${error.message}`);
    }
    this.#show();
  }

  #show() {
    this.element.querySelector('output').textContent = `${Number(this.time.toPrecision(5))} s`;
    for (const chart of this.charts) chart.draw();
    for (const [variable, place] of this.others) {
      const value = this.fmu.get(variable.name);
      place.textContent = variable.items.find(item => item.value === value)?.name ?? value;
    }
  }
}
