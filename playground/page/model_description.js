'use strict';

/**
 * A variable of an FMU, as modelDescription.xml has it.
 * @typedef {object} Variable
 * @property {string} name
 * @property {number} reference
 * @property {'Real'|'Integer'|'Boolean'|'Enumeration'} type
 * @property {string} causality
 * @property {string} variability
 * @property {string} initial '' where it has none
 * @property {string} unit as it is written; '' where it has none
 * @property {string} description
 * @property {number|null} start
 * @property {number|null} min
 * @property {number|null} max
 * @property {{name: string, value: number, description: string}[]} items of an enumeration
 */

/** modelDescription.xml of an FMU of FMI 2.0: its GUID and its variables. */
class ModelDescription {
  /** @param {string} xml */
  constructor(xml) {
    const root = new DOMParser().parseFromString(xml, 'text/xml').documentElement;
    this.name = root.getAttribute('modelName');
    this.guid = root.getAttribute('guid');
    this.version = root.getAttribute('fmiVersion') ?? 'an unknown version';
    this.text = root.getAttribute('description') ?? '';
    const experiment = root.querySelector('DefaultExperiment');
    const seconds = name => Number(experiment?.getAttribute(name) ?? 0);
    /** Of the default experiment, s; 0 for what it does not say. */
    this.experiment = {start: seconds('startTime'), stop: seconds('stopTime'), step: seconds('stepSize')};
    const types = new Map([...root.querySelectorAll('SimpleType')].map(
      type => [type.getAttribute('name'), ModelDescription.items(type)]));
    /** @type {Map<string, Variable>} */
    this.variables = new Map();
    for (const element of root.querySelectorAll('ScalarVariable')) {
      const variable = ModelDescription.variable(element, types);
      this.variables.set(variable.name, variable);
    }
  }

  static items(type) {
    return [...type.querySelectorAll('Item')].map(item => ({
      name: item.getAttribute('name'),
      value: Number(item.getAttribute('value')),
      description: item.getAttribute('description') ?? '',
    }));
  }

  static variable(element, types) {
    const of = element.firstElementChild;
    const number = name => (of.hasAttribute(name) ? Number(of.getAttribute(name)) : null);
    return {
      name: element.getAttribute('name'),
      reference: Number(element.getAttribute('valueReference')),
      type: of.tagName,
      causality: element.getAttribute('causality'),
      variability: element.getAttribute('variability'),
      initial: element.getAttribute('initial') ?? '',
      unit: ModelDescription.unit(of.getAttribute('unit') ?? ''),
      description: element.getAttribute('description') ?? '',
      start: of.tagName === 'Boolean' ? Number(of.getAttribute('start') === 'true') : number('start'),
      min: number('min'),
      max: number('max'),
      items: types.get(of.getAttribute('declaredType')) ?? [],
    };
  }

  /** A unit of FMI as it is written: N·m for N.m, m/s² for m/s2. @param {string} text */
  static unit(text) {
    return text.replace(/(?<=[a-z])[23]/g, digit => (digit === '2' ? '²' : '³')).replaceAll('.', '·');
  }

  /** @returns {Variable} */
  find(name) {
    const variable = this.variables.get(name);
    if (!variable) throw new Error(`${this.name} has no variable ${name}`);
    return variable;
  }
}
