'use strict';

/** Curves of the energies over the last seconds. */
class EnergyChart {
  static SPAN = 10; // s
  static INTERVAL = 0.02; // s between two points
  static TICK = 2; // s between two numbers at the axis of time
  static ROW = 14; // px between two numbers at the axis of energy
  static FONT = '12px system-ui, sans-serif';
  static CURVES = [['kinetic', '--curve1'], ['potential', '--curve2'], ['total', '--curve3']];

  /** @param {HTMLCanvasElement} canvas @param {Fmu} plant */
  constructor(canvas, plant) {
    this.canvas = canvas;
    this.energies = plant.reals(EnergyChart.CURVES.map(([name]) => `${name}_energy`));
    /** @type {number[][]} time in s, energies in J */
    this.rows = [];
  }

  /** Add the energies at `time` (s), unless the last ones are as new; drop what lies after it. */
  add(time) {
    while (this.rows.length && this.rows.at(-1)[0] > time) this.rows.pop();
    if (this.rows.length && time - this.rows.at(-1)[0] < EnergyChart.INTERVAL) return;
    this.rows.push([time, ...this.energies.get()]);
    const first = this.rows.findIndex(([then]) => then >= time - EnergyChart.SPAN);
    this.rows.splice(0, first);
  }

  clear() {
    this.rows.length = 0;
  }

  /** Range of the vertical axis, J. */
  #range() {
    const values = this.rows.flatMap(([, ...energies]) => energies);
    const lowest = Math.min(0, ...values), highest = Math.max(1, ...values);
    return [lowest, highest];
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    const {clientWidth: width, clientHeight: height} = this.canvas;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext('2d');
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = EnergyChart.FONT;
    const style = getComputedStyle(document.documentElement);
    const axes = this.#axes(context, width, height);
    this.#drawAxes(context, style, axes);
    this.#drawCurves(context, style, axes);
  }

  /**
   * The box of the curves, beside and above the numbers at the axes, in px; the places in it of a
   * time (s) and an energy (J); the numbers of both axes.
   */
  #axes(context, width, height) {
    const [lowest, highest] = this.#range();
    const end = Math.max(this.rows.at(-1)?.[0] ?? 0, EnergyChart.SPAN);
    const top = 12, bottom = height - 24;
    const y = energy => top + (bottom - top) * (highest - energy) / (highest - lowest);
    const room = Math.min(y(0) - top, bottom - y(0));
    const energies = [lowest, ...(room >= EnergyChart.ROW ? [0] : []), highest].map(
      energy => [energy, `${Number(energy.toPrecision(3))} J`]);
    const left = 12 + Math.max(...energies.map(([, text]) => context.measureText(text).width));
    const right = width - 24;
    const x = time => right - (right - left) * (end - time) / EnergyChart.SPAN;
    const {TICK, SPAN} = EnergyChart;
    const first = Math.ceil((end - SPAN) / TICK), last = Math.floor(end / TICK);
    const times = Array.from({length: last - first + 1}, (_, i) => (first + i) * TICK);
    return {left, right, top, bottom, x, y, energies, times};
  }

  #drawCurves(context, style, {x, y}) {
    EnergyChart.CURVES.forEach(([, colour], i) => {
      context.strokeStyle = style.getPropertyValue(colour);
      context.lineWidth = 2;
      context.setLineDash(i === 2 ? [6, 3] : []);
      context.beginPath();
      for (const row of this.rows) context.lineTo(x(row[0]), y(row[1 + i]));
      context.stroke();
    });
    context.setLineDash([]);
  }

  #drawAxes(context, style, {left, right, top, bottom, x, y, energies, times}) {
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
    for (const [energy, text] of energies) {
      line([left, y(energy)], [right, y(energy)]);
      context.fillText(text, left - 6, y(energy));
    }
    context.textAlign = 'center';
    context.textBaseline = 'top';
    for (const time of times) {
      line([x(time), top], [x(time), bottom]);
      context.fillText(`${time} s`, x(time), bottom + 8);
    }
  }
}
