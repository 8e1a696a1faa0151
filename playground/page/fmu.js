'use strict';

/** A call that an FMU refused; the message is the FMU's. */
class FmuError extends Error {
  /** @param {string} fmu its name @param {string} message */
  constructor(fmu, message) {
    super(message);
    this.fmu = fmu;
  }
}

/** An FMU in WebAssembly, with one instance of it for Co-Simulation; here of FMI 2.0. */
class Fmu {
  static CO_SIMULATION = 1;
  static WARNING = 1; // the worst fmi2Status of a call that succeeded
  // functions that the C library of an FMU imports: there are no files and one thread
  static NO_FILE = 8;
  static SYSTEM = {
    fd_close: () => Fmu.NO_FILE,
    fd_fdstat_get: () => Fmu.NO_FILE,
    fd_seek: () => Fmu.NO_FILE,
    fd_write: () => Fmu.NO_FILE,
    sched_yield: () => 0,
  };
  static LOGGED = 6; // arguments of the logger

  /**
   * A module that exports the function of int32 that it imports: only functions of modules fit into the table of an
   * FMU, where functions of JavaScript have no place. @param {number} count of its arguments
   */
  static logger(count) {
    return new Uint8Array([
      0, 0x61, 0x73, 0x6d, 1, 0, 0, 0,
      1, count + 4, 1, 0x60, count, ...Array(count).fill(0x7f), 0, // type 0
      2, 7, 1, 1, 0x65, 1, 0x66, 0, 0, // import function 0, e.f
      7, 5, 1, 1, 0x66, 0, 0, // export it as f
    ]);
  }

  /**
   * @param {Uint8Array} bytes of the module
   * @param {ModelDescription} description
   */
  static async load(bytes, description) {
    const module = await WebAssembly.instantiate(bytes, {wasi_snapshot_preview1: Fmu.SYSTEM});
    const kind = description.version === '3.0' ? Fmu3 : Fmu;
    const fmu = new kind(module.instance.exports, description);
    const log = (...given) => fmu.#log(...fmu.logged(...given));
    const logger = await WebAssembly.instantiate(Fmu.logger(kind.LOGGED), {e: {f: log}});
    const table = fmu.exports.__indirect_function_table;
    table.set(table.grow(1), logger.instance.exports.f);
    fmu.component = fmu.instantiate(table.length - 1);
    if (!fmu.component) throw fmu.#failure('instantiate');
    return fmu;
  }

  #messages = [];

  constructor(exports, description) {
    this.description = description;
    /** Called with the text of each warning. @type {(text: string) => void} */
    this.onWarning = () => {};
    /** @type {WebAssembly.Exports} */
    this.exports = exports;
    this.component = 0;
    exports._initialize();
    this.scratch = this.allocate(32); // a reference and a value, for get and set; the address of a state, for states
  }

  /** @param {number} logger its place in the table @returns {number} handle of the instance; 0 if it fails */
  instantiate(logger) {
    const callbacks = this.allocate(20); // four functions and the environment
    new Uint32Array(this.buffer, callbacks, 5).set([logger, 0, 0, 0, 0]);
    return this.named((name, guid) => this.exports.fmi2Instantiate(name, Fmu.CO_SIMULATION, guid, 0, callbacks, 0, 0));
  }

  /** Call `make` with the name of the instance and the GUID, as C has them. */
  named(make) {
    const texts = [this.description.name, this.description.guid].map(text => this.#cString(text));
    const made = make(...texts);
    for (const text of texts) this.exports.free(text);
    return made;
  }

  /** Status and text of a call of the logger. */
  logged(_environment, _name, status, _category, text) {
    return [status, this.text(text).replace(/##|%%/g, (twice) => twice[0])]; // FMI 2.0, section 2.1.5
  }

  // ---- memory

  /** Address of `size` bytes, for as long as the page is open. */
  allocate(size) {
    const address = this.exports.malloc(size);
    if (!address) throw new FmuError(this.description.name, `no memory for ${size} bytes`);
    return address;
  }

  /** The memory as it is now: it moves when it grows. */
  get buffer() {
    return this.exports.memory.buffer;
  }

  #cString(text) {
    const bytes = new TextEncoder().encode(`${text}\0`);
    const address = this.allocate(bytes.length);
    new Uint8Array(this.buffer, address, bytes.length).set(bytes);
    return address;
  }

  text(address) {
    const bytes = new Uint8Array(this.buffer, address);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  }

  // ---- calls

  #log(status, text) {
    if (status === Fmu.WARNING) this.onWarning(text);
    else this.#messages.push(text);
  }

  #failure(name) {
    const text = this.#messages.join('\n') || `${name} failed`;
    this.#messages.length = 0;
    return new FmuError(this.description.name, text);
  }

  /** Call a function of FMI with this instance; throws an FmuError where it fails. */
  call(name, ...values) {
    const status = this.exports[name](this.component, ...values);
    if (status > Fmu.WARNING) throw this.#failure(name);
  }

  reset() {
    this.call('fmi2Reset');
  }

  /** From instantiation or reset to initialization mode. @param {number} time in s */
  setUp(time) {
    this.call('fmi2SetupExperiment', 0, 0, time, 0, 0);
  }

  initialize() {
    this.call('fmi2EnterInitializationMode');
    this.call('fmi2ExitInitializationMode');
  }

  /** @param {number} time in s @param {number} length in s */
  doStep(time, length) {
    this.call('fmi2DoStep', time, length, 1);
  }

  // ---- values

  static KIND = {Real: 'Real', Integer: 'Integer', Enumeration: 'Integer', Boolean: 'Boolean'};

  #single(variable) {
    const size = variable.type === 'Real' ? Float64Array : Int32Array;
    new Uint32Array(this.buffer, this.scratch, 1)[0] = variable.reference;
    return new size(this.buffer, this.scratch + 8, 1);
  }

  /** Value of a variable of any type; of a Boolean, 0 or 1. */
  get(name) {
    const variable = this.description.find(name);
    const value = this.#single(variable);
    this.call(`fmi2Get${Fmu.KIND[variable.type]}`, this.scratch, 1, this.scratch + 8);
    return value[0];
  }

  set(name, value) {
    const variable = this.description.find(name);
    this.#single(variable)[0] = value;
    this.call(`fmi2Set${Fmu.KIND[variable.type]}`, this.scratch, 1, this.scratch + 8);
  }

  /** @param {string[]} names of Reals */
  reals(names) {
    return new Reals(this, names.map(name => this.description.find(name).reference));
  }

  // ---- states

  /** @returns {number} handle of a copy of the whole state; `freeState` when it is not needed */
  saveState() {
    const place = new Uint32Array(this.buffer, this.scratch, 1);
    place[0] = 0;
    this.call('fmi2GetFMUstate', this.scratch);
    return new Uint32Array(this.buffer, this.scratch, 1)[0];
  }

  restoreState(state) {
    this.call('fmi2SetFMUstate', state);
  }

  freeState(state) {
    new Uint32Array(this.buffer, this.scratch, 1)[0] = state;
    this.call('fmi2FreeFMUstate', this.scratch);
  }
}

/** Real variables that are read or set by one call. */
class Reals {
  /** @param {Fmu} fmu @param {number[]} references */
  constructor(fmu, references) {
    this.fmu = fmu;
    this.count = references.length;
    this.references = fmu.allocate(4 * this.count);
    this.address = fmu.allocate(8 * this.count);
    new Uint32Array(fmu.buffer, this.references, this.count).set(references);
    this.view = new Float64Array(0);
  }

  /** Their values where the FMU takes and writes them: valid until the next call. */
  values() {
    if (this.view.buffer !== this.fmu.buffer) {
      this.view = new Float64Array(this.fmu.buffer, this.address, this.count);
    }
    return this.view;
  }

  get() {
    this.fmu.call('fmi2GetReal', this.references, this.count, this.address);
    return this.values();
  }

  /** @param {ArrayLike<number>} numbers */
  set(numbers) {
    this.values().set(numbers);
    this.fmu.call('fmi2SetReal', this.references, this.count, this.address);
  }
}

/** An FMU of FMI 3.0: its values are read and set one by one. */
class Fmu3 extends Fmu {
  static LOGGED = 4;
  // an array for a value, by its type
  static KIND = {
    Float64: Float64Array, Float32: Float32Array, Int8: Int8Array, UInt8: Uint8Array, Int16: Int16Array,
    UInt16: Uint16Array, Int32: Int32Array, UInt32: Uint32Array, Int64: BigInt64Array, UInt64: BigUint64Array,
    Boolean: Uint8Array,
  };
  #begin = 0; // s

  instantiate(logger) {
    return this.named((name, token) =>
      this.exports.fmi3InstantiateCoSimulation(name, token, 0, 0, 0, 0, 0, 0, 0, 0, logger, 0));
  }

  logged(_environment, status, _category, text) {
    return [status, this.text(text)];
  }

  reset() {
    this.call('fmi3Reset');
  }

  setUp(time) {
    this.#begin = time;
  }

  initialize() {
    this.call('fmi3EnterInitializationMode', 0, 0, this.#begin, 0, 0);
    this.call('fmi3ExitInitializationMode');
  }

  doStep(time, length) {
    const told = this.scratch; // three Booleans and a time
    this.call('fmi3DoStep', time, length, 1, told, told + 1, told + 2, told + 8);
    if (new Uint8Array(this.buffer, told + 1, 1)[0]) {
      const [reached] = new Float64Array(this.buffer, told + 8, 1);
      throw new FmuError(this.description.name, `the FMU ends the simulation at t = ${reached} s`);
    }
  }

  #single({kind, reference}) {
    new Uint32Array(this.buffer, this.scratch, 1)[0] = reference;
    return new Fmu3.KIND[kind](this.buffer, this.scratch + 8, 1);
  }

  get(name) {
    const variable = this.description.find(name);
    const value = this.#single(variable);
    this.call(`fmi3Get${variable.kind}`, this.scratch, 1, this.scratch + 8, 1);
    return Number(value[0]);
  }

  set(name, value) {
    const variable = this.description.find(name);
    const place = this.#single(variable);
    place[0] = typeof place[0] === 'bigint' ? BigInt(value) : value;
    this.call(`fmi3Set${variable.kind}`, this.scratch, 1, this.scratch + 8, 1);
  }

  reals(names) {
    return {get: () => names.map(name => this.get(name))};
  }
}
