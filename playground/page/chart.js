'use strict';

/** Curves of variables of one unit over the last seconds, with their legend. */
class Chart {
  static SPAN = 10; // s
  static POINTS = 500; // in the span
  static TICKS = 5; // in the span
  static ROW = 14; // px between two numbers at the axis of values
  static FONT = '12px system-ui, sans-serif';
  static DASHES = ['solid', 'solid', 'dashed'];

  /**
   * @param {HTMLElement} element the figure is added to it
   * @param {Fmu} plant
   * @param {string} title
   * @param {number} least range of the axis of values
   * @param {string[]} names of the variables
   * @param {number} span s
   */
  constructor(element, plant, title, least, names, span = Chart.SPAN) {
    this.least = least;
    this.span = span;
    this.interval = span / Chart.POINTS;
    this.names = names;
    this.source = plant.reals(names);
    /** @type {number[][]} time in s, values */
    this.rows = [];
    const {unit} = plant.description.find(names[0]);
    const figure = document.createElement('figure');
    const caption = document.createElement('figcaption');
    caption.textContent = [title, unit && `(${unit})`].filter(Boolean).join(' ');
    if (names.length > 1) caption.append(this.#legend());
    this.canvas = document.createElement('canvas');
    this.canvas.setAttribute('role', 'img');
    this.canvas.setAttribute('aria-label',
      `${names.join(', ')} of the last ${span} s`);
    figure.append(caption, this.canvas);
    element.append(figure);
  }

  #legend() {
    const list = document.createElement('ul');
    this.names.forEach((name, i) => {
      const item = document.createElement('li');
      const swatch = document.createElement('span');
      swatch.className = 'swatch';
      swatch.style.borderTop = `3px ${Chart.DASHES[i]} var(--curve${i + 1})`;
      item.append(swatch, name);
      list.append(item);
    });
    return list;
  }

  /** Add the values at `time` (s), unless there are values at this time already; drop later ones. */
  add(time) {
    while (this.rows.length && this.rows.at(-1)[0] > time) this.rows.pop();
    if (this.rows.length && time - this.rows.at(-1)[0] < this.interval * (1 - 1e-9)) return;
    this.rows.push([time, ...this.source.get()]);
    const first = this.rows.findIndex(([then]) => then >= time - this.span);
    this.rows.splice(0, first);
  }

  clear() {
    this.rows.length = 0;
  }

  /** Range of the vertical axis, with 0 in it. */
  #range() {
    const values = this.rows.flatMap(([, ...row]) => row);
    const lowest = Math.min(0, ...values), highest = Math.max(0, ...values);
    return [lowest, Math.max(highest, lowest + (this.least || (highest > lowest ? 0 : 1)))];
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    const {clientWidth: width, clientHeight: height} = this.canvas;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext('2d');
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = Chart.FONT;
    const style = getComputedStyle(document.documentElement);
    const axes = this.#axes(context, width, height);
    this.#drawAxes(context, style, axes);
    this.#drawCurves(context, style, axes);
  }

  /**
   * The box of the curves, beside and above the numbers at the axes, in px; the places in it of a
   * time (s) and a value; the numbers of both axes.
   */
  #axes(context, width, height) {
    const [lowest, highest] = this.#range();
    const {ROW} = Chart, {span} = this, tick = span / Chart.TICKS;
    const end = Math.max(this.rows.at(-1)?.[0] ?? 0, (this.rows[0]?.[0] ?? 0) + span);
    const top = 12, bottom = height - 24;
    const y = value => top + (bottom - top) * (highest - value) / (highest - lowest);
    const room = Math.min(y(0) - top, bottom - y(0));
    const values = [lowest, ...(room >= ROW ? [0] : []), highest].map(
      value => [value, String(Number(value.toPrecision(3))).replace('-', '\u2212')]);
    const left = 12 + Math.max(...values.map(([, text]) => context.measureText(text).width));
    const right = width - 24;
    const x = time => right - (right - left) * (end - time) / span;
    const first = Math.ceil((end - span) / tick - 1e-6), last = Math.floor(end / tick + 1e-6);
    const times = Array.from({length: last - first + 1}, (_, i) => (first + i) * tick);
    return {left, right, top, bottom, x, y, values, times};
  }

  #drawCurves(context, style, {x, y}) {
    this.names.forEach((_, i) => {
      context.strokeStyle = style.getPropertyValue(`--curve${i + 1}`);
      context.lineWidth = 2;
      context.setLineDash(Chart.DASHES[i] === 'dashed' ? [6, 3] : []);
      context.beginPath();
      for (const row of this.rows) context.lineTo(x(row[0]), y(row[1 + i]));
      context.stroke();
    });
    context.setLineDash([]);
  }

  #drawAxes(context, style, {left, right, top, bottom, x, y, values, times}) {
    context.fillStyle = style.getPropertyValue('--ink');
    context.strokeStyle = style.getPropertyValue('--grid');
    context.lineWidth = 1;
    const line = (...points) => {
      context.beginPath();
      for (const point of points) context.lineTo(...point);
      context.stroke();
    };
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    line([left, y(0)], [right, y(0)]);
    for (const [value, text] of values) {
      line([left, y(value)], [right, y(value)]);
      context.fillText(text, left - 6, y(value));
    }
    context.textAlign = 'center';
    context.textBaseline = 'top';
    for (const time of times) {
      line([x(time), top], [x(time), bottom]);
      context.fillText(`${Number(time.toPrecision(6))} s`, x(time), bottom + 8);
    }
  }
}
