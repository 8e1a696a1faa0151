'use strict';

/** A call that an FMU refused; the message is the FMU's. */
class FmuError extends Error {
  /** @param {string} fmu its name @param {string} message */
  constructor(fmu, message) {
    super(message);
    this.fmu = fmu;
  }
}

/** An FMU of FMI 2.0 in WebAssembly, with one instance of it for Co-Simulation. */
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
  // a module that exports the function of six int32 that it imports: only functions of modules fit into the table
  // of an FMU, where functions of JavaScript have no place
  static LOGGER = new Uint8Array([
    0, 0x61, 0x73, 0x6d, 1, 0, 0, 0,
    1, 10, 1, 0x60, 6, 0x7f, 0x7f, 0x7f, 0x7f, 0x7f, 0x7f, 0, // type 0
    2, 7, 1, 1, 0x65, 1, 0x66, 0, 0, // import function 0, e.f
    7, 5, 1, 1, 0x66, 0, 0, // export it as f
  ]);

  /**
   * @param {Uint8Array} bytes of the module
   * @param {ModelDescription} description
   */
  static async load(bytes, description) {
    const module = await WebAssembly.instantiate(bytes, {wasi_snapshot_preview1: Fmu.SYSTEM});
    const fmu = new Fmu(module.instance.exports, description);
    const log = (_environment, _name, status, _category, text) => fmu.#log(status, fmu.#text(text));
    const logger = await WebAssembly.instantiate(Fmu.LOGGER, {e: {f: log}});
    fmu.#instantiate(logger.instance.exports.f);
    return fmu;
  }

  /** @type {WebAssembly.Exports} */ #exports;
  #component = 0;
  #messages = [];
  #scratch = 0; // a reference and a value, for get and set; the address of a state, for states

  constructor(exports, description) {
    this.description = description;
    /** Called with the text of each warning. @type {(text: string) => void} */
    this.onWarning = () => {};
    this.#exports = exports;
    exports._initialize();
    this.#scratch = this.allocate(16);
  }

  #instantiate(logger) {
    const table = this.#exports.__indirect_function_table;
    table.set(table.grow(1), logger);
    const callbacks = this.allocate(20); // four functions and the environment
    new Uint32Array(this.#exports.memory.buffer, callbacks, 5).set([table.length - 1, 0, 0, 0, 0]);
    const name = this.#cString(this.description.name), guid = this.#cString(this.description.guid);
    this.#component =
      this.#exports.fmi2Instantiate(name, Fmu.CO_SIMULATION, guid, 0, callbacks, 0, 0);
    this.#exports.free(name);
    this.#exports.free(guid);
    if (!this.#component) throw this.#failure('fmi2Instantiate');
  }

  // ---- memory

  /** Address of `size` bytes, for as long as the page is open. */
  allocate(size) {
    const address = this.#exports.malloc(size);
    if (!address) throw new FmuError(this.description.name, `no memory for ${size} bytes`);
    return address;
  }

  /** The memory as it is now: it moves when it grows. */
  get buffer() {
    return this.#exports.memory.buffer;
  }

  #cString(text) {
    const bytes = new TextEncoder().encode(`${text}\0`);
    const address = this.allocate(bytes.length);
    new Uint8Array(this.buffer, address, bytes.length).set(bytes);
    return address;
  }

  #text(address) {
    const bytes = new Uint8Array(this.buffer, address);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0))).replaceAll('##', '#');
  }

  // ---- calls

  #log(status, sent) {
    const text = sent.replace(/##|%%/g, (twice) => twice[0]); // FMI 2.0, section 2.1.5
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
    const status = this.#exports[name](this.#component, ...values);
    if (status > Fmu.WARNING) throw this.#failure(name);
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
    new Uint32Array(this.buffer, this.#scratch, 1)[0] = variable.reference;
    return new size(this.buffer, this.#scratch + 8, 1);
  }

  /** Value of a variable of any type; of a Boolean, 0 or 1. */
  get(name) {
    const variable = this.description.find(name);
    const value = this.#single(variable);
    this.call(`fmi2Get${Fmu.KIND[variable.type]}`, this.#scratch, 1, this.#scratch + 8);
    return value[0];
  }

  set(name, value) {
    const variable = this.description.find(name);
    this.#single(variable)[0] = value;
    this.call(`fmi2Set${Fmu.KIND[variable.type]}`, this.#scratch, 1, this.#scratch + 8);
  }

  /** @param {string[]} names of Reals */
  reals(names) {
    return new Reals(this, names.map(name => this.description.find(name).reference));
  }

  // ---- states

  /** @returns {number} handle of a copy of the whole state; `freeState` when it is not needed */
  saveState() {
    const place = new Uint32Array(this.buffer, this.#scratch, 1);
    place[0] = 0;
    this.call('fmi2GetFMUstate', this.#scratch);
    return new Uint32Array(this.buffer, this.#scratch, 1)[0];
  }

  restoreState(state) {
    this.call('fmi2SetFMUstate', state);
  }

  freeState(state) {
    new Uint32Array(this.buffer, this.#scratch, 1)[0] = state;
    this.call('fmi2FreeFMUstate', this.#scratch);
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
