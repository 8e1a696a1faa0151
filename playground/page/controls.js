'use strict';

/** Sliders, number fields and choices for variables of the FMUs. */
class Controls {
  /**
   * @param {Simulation} simulation
   * @param {(fmu: string, variable: Variable, value: number) => void} change
   *   sets a variable, or says why not
   * @param {(text: string) => void} say shows a message
   */
  constructor(simulation, change, say) {
    this.simulation = simulation;
    this.change = change;
    this.say = say;
    this.refreshers = [];
  }

  /** All groups of Settings, closed, into `element`. @param {HTMLElement} element */
  addGroups(element) {
    for (const group of Settings.groups) {
      const details = document.createElement('details');
      const summary = document.createElement('summary');
      summary.textContent = group.title;
      details.append(summary);
      for (const [name, ...range] of group.controls) this.addVariable(details, group.fmu, name, range);
      element.append(details);
    }
  }

  /** A control for a variable of an FMU. @param {number[]} range smallest, largest, step */
  addVariable(element, fmu, name, range) {
    const variable = this.simulation.fmus[fmu].description.find(name);
    const read = () => this.simulation.fmus[fmu].get(name);
    const write = value => this.change(fmu, variable, value);
    if (variable.items.length) this.#addChoice(element, fmu, variable, read, write);
    else this.addSlider(element, `${fmu}-${name}`, variable, range, read, write);
  }

  #row(element, id, variable) {
    const row = document.createElement('div');
    row.className = 'control';
    row.title = variable.description;
    const label = document.createElement('label');
    label.htmlFor = id;
    label.textContent = variable.name;
    if (variable.unit && variable.unit !== '1') {
      const unit = document.createElement('span');
      unit.className = 'unit';
      unit.textContent = variable.unit;
      label.append(' ', unit);
    }
    row.append(label);
    element.append(row);
    return row;
  }

  /** A slider with a field that takes any number. */
  addSlider(element, id, variable, [smallest, largest, step], read, write) {
    const row = this.#row(element, id, variable);
    const slider = Object.assign(document.createElement('input'),
      {type: 'range', id, min: smallest, max: largest, step});
    const field = Object.assign(document.createElement('input'), {type: 'number', step: 'any'});
    field.setAttribute('aria-label', `${variable.name} as a number`);
    row.append(slider, field);
    const show = () => {
      const value = read();
      // the text that was typed may have more digits than are shown
      if (document.activeElement !== field || field.valueAsNumber !== value) {
        field.value = String(Number(value.toPrecision(6)));
      }
      slider.value = value;
    };
    const set = value => {
      write(value);
      show();
    };
    slider.addEventListener('input', () => set(slider.valueAsNumber));
    field.addEventListener('change', () => {
      if (Number.isFinite(field.valueAsNumber)) {
        set(field.valueAsNumber);
      } else {
        show();
        this.say(`${variable.name} must be a number: it is still ${field.value}`);
      }
    });
    this.refreshers.push(show);
  }

  #addChoice(element, fmu, variable, read, write) {
    const id = `${fmu}-${variable.name}`;
    const row = this.#row(element, id, variable);
    const choice = Object.assign(document.createElement('select'), {id});
    for (const {name, value, description} of variable.items) {
      const option = new Option(name, value);
      option.title = description;
      choice.append(option);
    }
    choice.addEventListener('change', () => {
      write(Number(choice.value));
      choice.value = read();
    });
    row.append(choice);
    this.refreshers.push(() => { choice.value = read(); });
  }

  /** Show the FMUs' values after a reset or a restore. */
  refresh() {
    for (const refresh of this.refreshers) refresh();
  }
}
