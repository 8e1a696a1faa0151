'use strict';

/** The page: buttons, controls, drawings and the loop that runs the FMUs at real time. */
class Playground {
  static BACK = 0.2; // s, of the button
  static LONGEST = 0.1; // s of wall time that one frame makes up for at most
  static BUDGET = 25; // ms of computing in one frame
  static REFRESH = 100; // ms between two updates of the numbers

  /** @param {Fmu} plant @param {Fmu} controller */
  constructor(plant, controller) {
    this.simulation = new Simulation(plant, controller);
    this.speed = 1;
    this.saved = null;
    this.debt = 0; // s, simulated time that is due
    this.message = document.getElementById('message');
    for (const fmu of [plant, controller]) {
      fmu.onWarning = text => this.say(`${fmu.description.name}: ${text}`);
    }
    this.#addScenes();
    this.#start();
    this.controls = new Controls(
      this.simulation, (...change) => this.change(...change), text => this.say(text));
    this.#addControls();
    this.numbers = new Numbers(document.getElementById('numbers'), plant);
    this.stage = new Stage(document.getElementById('stage'), this.simulation);
    this.charts = Settings.charts.map(
      chart => new Chart(document.getElementById('charts'), plant, ...chart));
    this.#addButtons();
    this.#addHistory();
    this.#addKeys();
    this.play(!matchMedia('(prefers-reduced-motion: reduce)').matches);
    this.show();
    this.#addOwn();
    requestAnimationFrame(now => this.#frame(now, now, 0));
  }

  // ---- parts of the page

  #addScenes() {
    const choice = document.getElementById('setting');
    for (const name of Object.keys(Settings.scenes)) choice.append(new Option(name));
    choice.addEventListener('change', () => this.reset());
  }

  /** Start the chosen scene at time 0. */
  #start() {
    const scene = document.getElementById('setting').value;
    const {plant, controller} = Settings.scenes[scene];
    const {common} = Settings;
    this.simulation.start({
      plant: {...common.plant, ...plant}, controller: {...common.controller, ...controller},
    }, scene);
  }

  #addControls() {
    const {simulation, controls} = this;
    const own = (id, variable, range, values, i) => controls.addSlider(document.getElementById(id),
      `${id}-${variable.name}`, variable, range, () => values()[i],
      value => this.#attempt(variable, value, () => simulation.attempt(() => { values()[i] = value; })));
    const find = (fmu, name) => simulation.fmus[fmu].description.find(name);
    own('efforts', find('plant', 'tau1'), [-40, 40, 0.5], () => simulation.efforts, 0);
    own('efforts', find('plant', 'f2'), [-60, 60, 0.5], () => simulation.efforts, 1);
    own('set-point', find('controller', 'q1_ref'), [-3.14, 3.14, 0.01], () => simulation.reference, 0);
    own('set-point', find('controller', 'q2_ref'), [-0.5, 0.5, 0.01], () => simulation.reference, 1);
    controls.addGroups(document.getElementById('groups'));
    this.#addLaw();
    this.#addPayload();
    controls.refreshers.push(() => {
      document.getElementById('setting').value = simulation.scene;
    });
    controls.refresh();
  }

  /** The controller's mode, with one more: off. */
  #addLaw() {
    const {simulation} = this;
    const choice = document.getElementById('law');
    const mode = simulation.fmus.controller.description.find('mode');
    choice.append(new Option('off', 0));
    for (const {name, value} of mode.items) choice.append(new Option(name, value));
    const show = () => {
      choice.value = simulation.isControlled ? simulation.fmus.controller.get('mode') : 0;
    };
    choice.addEventListener('change', () => {
      const value = Number(choice.value);
      this.#attempt(mode, value, () => simulation.control(value));
      show();
    });
    this.controls.refreshers.push(show);
  }

  #addPayload() {
    const box = document.getElementById('payload');
    const {plant} = this.simulation.fmus;
    const show = () => { box.checked = plant.get('payload_attached') === 1; };
    box.addEventListener('change', () => {
      this.change('plant', plant.description.find('payload_attached'), Number(box.checked));
      show();
    });
    this.controls.refreshers.push(show);
  }

  #addButtons() {
    const on = (id, act) => document.getElementById(id).addEventListener('click', act);
    on('play', () => this.play(!this.isRunning));
    on('reset', () => this.reset());
    on('back', () => this.#stepBack());
    on('save', () => this.save());
    on('restore', () => this.restore());
    on('measure', () => this.#measure());
    document.getElementById('speed').addEventListener('change', event => {
      this.speed = Number(event.target.value);
    });
  }

  /** The slider of the history goes over the states that are kept. */
  #addHistory() {
    this.history = document.getElementById('history');
    this.history.addEventListener('input', () => {
      this.play(false);
      this.goBack(this.history.valueAsNumber);
    });
  }

  /** Keys of the drawing, besides those that push the arm. */
  #addKeys() {
    const acts = {' ': () => this.play(!this.isRunning), Backspace: () => this.#stepBack()};
    this.stage.canvas.addEventListener('keydown', event => {
      if (!(event.key in acts)) return;
      event.preventDefault();
      acts[event.key]();
    });
  }

  /** FMUs that are dropped on the page, or chosen, take the place of the arm. */
  #addOwn() {
    const [notice, input, back] = ['notice', 'file', 'arm'].map(id => document.getElementById(id));
    const parts = [document.querySelector('main'), document.getElementById('own')];
    const say = text => {
      notice.textContent = text;
      notice.hidden = !text;
    };
    const swap = isOwn => {
      [parts[0].hidden, parts[1].hidden, back.hidden] = [isOwn, !isOwn, !isOwn];
      this.own?.end();
      say('');
    };
    const take = async file => {
      try {
        const fmu = await Own.load(file);
        this.play(false);
        swap(true);
        this.own = new Own(parts[1], fmu, say);
      } catch (error) {
        if (!(error instanceof UnsuitedError || error instanceof FmuError)) throw error;
        say(`${file.name}: ${error.message}`);
      }
    };
    input.addEventListener('change', () => {
      if (input.files.length) take(input.files[0]);
      input.value = '';
    });
    back.addEventListener('click', () => {
      swap(false);
      this.stage.fit();
    });
    document.addEventListener('dragover', event => event.preventDefault());
    document.addEventListener('drop', event => {
      event.preventDefault();
      if (event.dataTransfer.files.length) take(event.dataTransfer.files[0]);
    });
  }

  // ---- actions of the user

  play(isRunning) {
    this.isRunning = isRunning;
    if (isRunning) this.message.hidden = true;
    document.getElementById('play').textContent = isRunning ? 'Pause' : 'Play';
  }

  /** Start the chosen scene again at time 0. */
  reset() {
    this.#start();
    this.#clearCharts();
    this.#arrive();
  }

  /** Set a variable of an FMU, or show why the FMU refuses it. */
  change(name, variable, value) {
    this.#attempt(variable, value, () => this.simulation.change(name, variable.name, value));
  }

  /** Call a function that gives a variable this value, or show why the FMU refuses it. */
  #attempt(variable, value, act) {
    try {
      act();
      this.message.hidden = true;
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      const shown = variable.items.find(item => item.value === value)?.name ?? value;
      this.say(`${error.fmu} refuses ${variable.name} = ${shown}:\n${error.message}`);
    }
    this.stage.fit();
    this.show();
  }

  save() {
    if (this.saved) this.simulation.free(this.saved);
    this.saved = this.simulation.save();
    document.getElementById('restore').disabled = false;
  }

  restore() {
    if (this.saved.run !== this.simulation.run) this.#clearCharts();
    this.simulation.restore(this.saved);
    this.#arrive();
  }

  /** @param {number} time in s */
  goBack(time) {
    if (this.simulation.goBack(time)) this.#arrive();
  }

  #stepBack() {
    this.goBack(this.simulation.time - Playground.BACK);
  }

  /** Show the state that the simulation has jumped to. */
  #arrive() {
    this.message.hidden = true;
    this.stage.path.length = 0;
    this.controls.refresh();
    this.stage.fit();
    this.show();
  }

  /** @param {string} text */
  say(text) {
    this.message.textContent = text;
    this.message.hidden = false;
  }

  // ---- running

  /** @param {number} now ms @param {number} before ms @param {number} shown ms, of the numbers */
  #frame(now, before, shown) {
    if (this.isRunning) this.#run((now - before) / 1e3);
    this.stage.draw();
    const isDue = now - shown >= Playground.REFRESH;
    if (isDue) this.show();
    requestAnimationFrame(next => this.#frame(next, now, isDue ? now : shown));
  }

  /** Steps for `passed` seconds of wall time, but no more than fit into a frame. */
  #run(passed) {
    const end = performance.now() + Playground.BUDGET;
    this.debt += this.speed * Math.min(passed, Playground.LONGEST);
    try {
      while (this.debt >= Simulation.STEP) {
        if (performance.now() > end) {
          this.debt = 0;
          break;
        }
        this.#step();
        this.debt -= Simulation.STEP;
      }
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      this.#recover(error);
    }
  }

  #step() {
    this.simulation.step();
    if (this.simulation.steps % 10 === 0) {
      this.stage.follow();
      for (const chart of this.charts) chart.add(this.simulation.time);
    }
  }

  /** A step failed: stop at the last state that is kept, and say why. */
  #recover(error) {
    this.debt = 0;
    this.play(false);
    this.goBack(this.simulation.time);
    this.say(error.message);
  }

  #clearCharts() {
    for (const chart of this.charts) chart.clear();
  }

  /** Numbers, history and charts as they are now. */
  show() {
    const {snapshots, time} = this.simulation;
    this.numbers.refresh();
    this.history.min = snapshots[0] ? snapshots[0].steps * Simulation.STEP : 0;
    this.history.max = Math.max(time, (snapshots.at(-1)?.steps ?? 0) * Simulation.STEP);
    this.history.value = time;
    document.getElementById('time').textContent = `${time.toFixed(2)} s`;
    for (const chart of this.charts) chart.draw();
  }

  #measure() {
    const output = document.getElementById('factor');
    output.textContent = '';
    try {
      const {factor, step} = this.benchmark();
      output.textContent =
        `${factor.toFixed(0)} times real time: ${(1e6 * step).toFixed(1)} µs for a step of 1 ms`;
    } catch (error) {
      if (!(error instanceof FmuError)) throw error;
      this.say(`The speed cannot be measured from here:\n${error.message}`);
    }
  }

  /**
   * How fast it runs without drawing, from where it is: afterwards it is there again, also where a
   * step fails, with an FmuError.
   * @param {number} steps
   * @param {number} repetitions from the same state; the fastest counts
   * @returns {{factor: number, step: number}} times real time; s for a step
   */
  benchmark(steps = 2000, repetitions = 5) {
    const here = this.simulation.save();
    let fastest = Infinity;
    try {
      for (let repetition = 0; repetition < repetitions; repetition++) {
        this.simulation.restore(here);
        const start = performance.now();
        for (let i = 0; i < steps; i++) this.simulation.advance();
        fastest = Math.min(fastest, (performance.now() - start) / 1e3);
      }
    } finally {
      this.simulation.restore(here);
      this.simulation.free(here);
    }
    return {factor: steps * Simulation.STEP / fastest, step: fastest / steps};
  }
}

/** An FMU that the page holds: its description as XML, its module in base64. */
async function loadFmu(name) {
  const text = kind => document.getElementById(`${name}-${kind}`).textContent;
  const bytes = Uint8Array.from(atob(text('module')), character => character.charCodeAt(0));
  return Fmu.load(bytes, new ModelDescription(text('description')));
}

/** @type {Promise<Playground>} */
const playground = Promise.all(['RPPlant', 'RPController'].map(loadFmu))
  .then(([plant, controller]) => new Playground(plant, controller));
playground.catch(error => {
  const message = document.getElementById('message');
  message.textContent = `The playground does not start: ${error.message}`;
  message.hidden = false;
});
