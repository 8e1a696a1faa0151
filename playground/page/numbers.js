'use strict';

/** Tables of variables of the plant while it runs. */
class Numbers {
  /** @param {HTMLElement} element @param {Fmu} plant */
  constructor(element, plant) {
    this.rows = [];
    for (const [title, names] of Settings.shown) {
      const table = document.createElement('table');
      table.createCaption().textContent = title;
      const body = table.createTBody();
      for (const name of names) this.rows.push(Numbers.#row(body, plant, name));
      element.append(table);
    }
  }

  static #row(body, plant, name) {
    const variable = plant.description.find(name);
    const row = body.insertRow();
    const head = document.createElement('th');
    head.scope = 'row';
    head.textContent = name;
    row.title = variable.description;
    row.append(head);
    const cell = row.insertCell();
    cell.id = `value-${name}`;
    const unit = variable.unit === '1' ? '' : variable.unit;
    return () => {
      const value = plant.get(name);
      cell.textContent = `${Numbers.format(variable, value).replaceAll('-', '\u2212')} ${unit}`.trim();
    };
  }

  /** @param {Variable} variable @param {number} value */
  static format(variable, value) {
    if (variable.name === 'mode1' || variable.name === 'mode2') return Settings.modes[value];
    if (variable.type !== 'Real') return String(value);
    const size = Math.abs(value);
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(2);
    return value.toFixed(3);
  }

  refresh() {
    for (const refresh of this.rows) refresh();
  }
}
