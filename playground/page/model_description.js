'use strict';

/**
 * A variable of an FMU, as modelDescription.xml has it.
 * @typedef {object} Variable
 * @property {string} name
 * @property {number} reference
 * @property {'Real'|'Integer'|'Boolean'|'Enumeration'|'String'} type
 * @property {string} kind Float64 or Int32, say, as the functions of FMI 3.0 have it in their names
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

/** modelDescription.xml of an FMU: its GUID, the token of FMI 3.0, and its variables. */
class ModelDescription {
  static KINDS = /^(Float|U?Int)(8|16|32|64)$|^(Boolean|Enumeration)$/; // of FMI 3.0, which the page reads and sets

  /** @param {string} xml */
  constructor(xml) {
    const root = new DOMParser().parseFromString(xml, 'text/xml').documentElement;
    this.name = root.getAttribute('modelName');
    this.guid = root.getAttribute('guid') ?? root.getAttribute('instantiationToken');
    this.version = root.getAttribute('fmiVersion') ?? 'an unknown version';
    this.text = root.getAttribute('description') ?? '';
    const experiment = root.querySelector('DefaultExperiment');
    const seconds = name => Number(experiment?.getAttribute(name) ?? 0);
    /** Of the default experiment, s; 0 for what it does not say. */
    this.experiment = {start: seconds('startTime'), stop: seconds('stopTime'), step: seconds('stepSize')};
    const types = new Map([...root.querySelectorAll('TypeDefinitions > *')].map(
      type => [type.getAttribute('name'), {items: ModelDescription.items(type), unit: type.getAttribute('unit') ?? ''}]));
    /** @type {Map<string, Variable>} */
    this.variables = new Map();
    const isThree = this.version === '3.0';
    for (const element of root.querySelectorAll(isThree ? 'ModelVariables > *' : 'ScalarVariable')) {
      if (isThree && (!ModelDescription.KINDS.test(element.tagName) || element.querySelector('Dimension'))) continue;
      const variable = ModelDescription.variable(element, isThree ? element : element.firstElementChild, types);
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

  static variable(element, of, types) {
    const type = types.get(of.getAttribute('declaredType'));
    const number = name => (of.hasAttribute(name) ? Number(of.getAttribute(name)) : null);
    return {
      name: element.getAttribute('name'),
      reference: Number(element.getAttribute('valueReference')),
      type: of.tagName.replace(/^Float\d+$/, 'Real').replace(/^U?Int\d+$/, 'Integer'),
      kind: of.tagName.replace('Enumeration', 'Int64'),
      causality: element.getAttribute('causality'),
      variability: element.getAttribute('variability'),
      initial: element.getAttribute('initial') ?? '',
      unit: ModelDescription.unit(of.getAttribute('unit') ?? type?.unit ?? ''),
      description: element.getAttribute('description') ?? '',
      start: of.tagName === 'Boolean' ? Number(of.getAttribute('start') === 'true') : number('start'),
      min: number('min'),
      max: number('max'),
      items: type?.items ?? [],
    };
  }

  /** A unit of FMI as it is written: N·m for N.m, m/s² for m/s2. @param {string} text */
  static unit(text) {
    const raised = text.replace(/(?<=[a-z])[23](?!\.?\d)/g, digit => (digit === '2' ? '²' : '³'));
    return raised.replace(/\.(?!\d)/g, '·');
  }

  /** @returns {Variable} */
  find(name) {
    const variable = this.variables.get(name);
    if (!variable) throw new Error(`${this.name} has no variable ${name}`);
    return variable;
  }
}
