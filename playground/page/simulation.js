'use strict';

/**
 * Plant and controller, coupled every millisecond as an importer couples them: the controller reads
 * the motion, the plant takes its efforts, both do a step. The user's efforts are added to the
 * controller's. A hand pulls at the end effector like a spring with damping, or pushes it.
 */
class Simulation {
  static STEP = 1e-3; // s
  static SNAPSHOT_EVERY = 50; // steps
  static SNAPSHOTS = 240; // 12 s to go back to
  static HAND = {stiffness: 80, damping: 8, largest: 80}; // N/m, N.s/m, N

  /** @param {Fmu} plant @param {Fmu} controller */
  constructor(plant, controller) {
    this.fmus = {plant, controller};
    this.scene = ''; // name of the scene that it started with
    this.run = Symbol(); // another one after each start
    this.motion = plant.reals(['q1', 'q2', 'dq1', 'dq2']);
    this.tip = plant.reals(['ee_x', 'ee_y', 'ee_vx', 'ee_vy']);
    this.inputs = plant.reals(['tau1', 'f2', 'ee_fx', 'ee_fy']);
    this.measured = controller.reals(['q1_ref', 'q2_ref', 'q1', 'q2', 'dq1', 'dq2']);
    this.commanded = controller.reals(['tau1', 'f2']);
    this.steps = 0;
    this.efforts = [0, 0]; // N.m, N: the user's
    this.reference = [0, 0]; // rad, m: for the controller
    this.isControlled = false;
    this.hand = {target: null, push: [0, 0]}; // m or null, N
    /** @type {object[]} oldest first */
    this.snapshots = [];
  }

  /** s */
  get time() {
    return this.steps * Simulation.STEP;
  }

  // ---- start

  /**
   * Start at time 0, without efforts, the controller off.
   * @param {{plant: Object<string, number>, controller: Object<string, number>}} values what
   *   differs from the start values of the FMUs
   * @param {string} scene name of these values
   */
  start(values, scene = this.scene) {
    this.forget();
    this.scene = scene;
    this.run = Symbol();
    this.steps = 0;
    this.efforts = [0, 0];
    this.reference = [0, 0];
    this.isControlled = false;
    this.#initialize(values);
  }

  #initialize(values) {
    for (const [name, fmu] of Object.entries(this.fmus)) {
      fmu.call('fmi2Reset');
      fmu.setUp(this.time);
      for (const [variable, value] of Object.entries(values[name] ?? {})) fmu.set(variable, value);
      fmu.initialize();
    }
  }

  /** Parameters, states and inputs, which bring an FMU to where it is now when it starts again. */
  #present(fmu) {
    const variables = [...fmu.description.variables.values()].filter(
      ({causality, initial}) => causality === 'input' || initial === 'exact');
    return Object.fromEntries(variables.map(({name}) => [name, fmu.get(name)]));
  }

  // ---- steps

  #handForce(tip) {
    const {target, push} = this.hand;
    if (!target) return push;
    const {stiffness, damping, largest} = Simulation.HAND;
    const [x, y, vx, vy] = tip;
    const fx = stiffness * (target[0] - x) - damping * vx;
    const fy = stiffness * (target[1] - y) - damping * vy;
    const scale = Math.min(1, largest / Math.max(Math.sqrt(fx * fx + fy * fy), 1e-9));
    return [scale * fx + push[0], scale * fy + push[1]];
  }

  #effort() {
    if (!this.isControlled) return this.efforts;
    const [q1, q2, dq1, dq2] = this.motion.get();
    this.measured.set([this.reference[0], this.reference[1], q1, q2, dq1, dq2]);
    const [tau1, f2] = this.commanded.get();
    return [this.efforts[0] + tau1, this.efforts[1] + f2];
  }

  /** One communication step of both; now and then the state before it is kept. */
  step() {
    if (this.steps % Simulation.SNAPSHOT_EVERY === 0) this.#keep();
    this.advance();
  }

  /** One communication step of both. */
  advance() {
    const [tau1, f2] = this.#effort();
    const [fx, fy] = this.#handForce(this.hand.target ? this.tip.get() : null);
    this.inputs.set([tau1, f2, fx, fy]);
    const {plant, controller} = this.fmus;
    plant.doStep(this.time, Simulation.STEP);
    controller.doStep(this.time, Simulation.STEP);
    this.steps++;
  }

  // ---- changes

  /**
   * Set a variable between two steps. One that is fixed starts both FMUs again at the present time,
   * in the present state. A value that an FMU refuses changes nothing: throws an FmuError.
   * @param {'plant'|'controller'} name of the FMU
   */
  change(name, variable, value) {
    this.attempt(() => this.#set(name, variable, value));
  }

  #set(name, variable, value) {
    const fmu = this.fmus[name];
    if (fmu.description.find(variable).variability === 'fixed') {
      const {plant, controller} = this.fmus;
      const values = {plant: this.#present(plant), controller: this.#present(controller)};
      values[name][variable] = value;
      this.#initialize(values);
    } else {
      fmu.set(variable, value);
    }
  }

  /** Turn the controller on, with the law of this number, or off by 0; refused as by `change`. */
  control(mode) {
    this.attempt(() => {
      this.isControlled = mode > 0;
      if (this.isControlled) this.#set('controller', 'mode', mode);
    });
  }

  /**
   * Change something between two steps. Where an FMU refuses it, or the next step, nothing is
   * changed: throws an FmuError.
   * @param {() => void} act
   */
  attempt(act) {
    const before = this.save();
    try {
      act();
      this.#tryStep();
    } catch (error) {
      this.restore(before);
      throw error;
    } finally {
      this.free(before);
    }
  }

  /** Efforts that are too large, and values that do not fit each other, are refused by the step. */
  #tryStep() {
    const here = this.save();
    try {
      this.advance();
      this.restore(here);
    } finally {
      this.free(here);
    }
  }

  // ---- states

  /** Return the state of both FMUs and the user's settings; `free` it later. */
  save() {
    const states = Object.fromEntries(
      Object.entries(this.fmus).map(([name, fmu]) => [name, fmu.saveState()]));
    const {scene, run, steps, efforts, reference, isControlled} = this;
    return {
      states, scene, run, steps, efforts: [...efforts], reference: [...reference], isControlled,
    };
  }

  /** Back to a state that was saved; the history of another start is dropped. */
  restore(saved) {
    if (saved.run !== this.run) this.forget();
    for (const [name, fmu] of Object.entries(this.fmus)) fmu.restoreState(saved.states[name]);
    this.scene = saved.scene;
    this.run = saved.run;
    this.steps = saved.steps;
    this.efforts = [...saved.efforts];
    this.reference = [...saved.reference];
    this.isControlled = saved.isControlled;
  }

  free(saved) {
    for (const [name, fmu] of Object.entries(this.fmus)) fmu.freeState(saved.states[name]);
  }

  // ---- back in time

  #keep() {
    if (this.snapshots.at(-1)?.steps >= this.steps) this.#forgetSince(this.steps);
    this.snapshots.push(this.save());
    if (this.snapshots.length > Simulation.SNAPSHOTS) this.free(this.snapshots.shift());
  }

  #forgetSince(steps) {
    while (this.snapshots.length && this.snapshots.at(-1).steps >= steps) {
      this.free(this.snapshots.pop());
    }
  }

  /** Drop all snapshots. */
  forget() {
    this.#forgetSince(-Infinity);
  }

  /** Go to the last snapshot not after `time` (s), or to the oldest. @returns {boolean} false: none */
  goBack(time) {
    const wanted = Math.round(time / Simulation.STEP);
    const found = this.snapshots.findLast(({steps}) => steps <= wanted) ?? this.snapshots[0];
    if (!found) return false;
    this.restore(found);
    return true;
  }
}
