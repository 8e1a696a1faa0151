'use strict';

/** Curves of the energies over the last seconds. */
class EnergyChart {
  static SPAN = 10; // s
  static INTERVAL = 0.02; // s between two points
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
    const style = getComputedStyle(document.documentElement);
    const [low, high] = this.#range();
    const end = Math.max(this.rows.at(-1)?.[0] ?? 0, EnergyChart.SPAN);
    const x = time => width * (1 - (end - time) / EnergyChart.SPAN);
    const y = energy => 8 + (height - 16) * (high - energy) / (high - low);
    this.#drawAxis(context, style, width, y);
    EnergyChart.CURVES.forEach(([, colour], i) => {
      context.strokeStyle = style.getPropertyValue(colour);
      context.lineWidth = 2;
      context.setLineDash(i === 2 ? [6, 3] : []);
      context.beginPath();
      for (const row of this.rows) context.lineTo(x(row[0]), y(row[1 + i]));
      context.stroke();
    });
    context.setLineDash([]);
    this.#drawEnds(context, style, height, low, high);
  }

  #drawAxis(context, style, width, y) {
    context.strokeStyle = style.getPropertyValue('--grid');
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(0, y(0));
    context.lineTo(width, y(0));
    context.stroke();
  }

  /** Ends of the axis, legible over the curves. */
  #drawEnds(context, style, height, low, high) {
    context.font = '12px system-ui, sans-serif';
    context.fillStyle = style.getPropertyValue('--ink');
    context.strokeStyle = style.getPropertyValue('--paper');
    context.lineWidth = 4;
    context.lineJoin = 'round';
    for (const [energy, baseline, y] of [[high, 'top', 4], [low, 'bottom', height - 4]]) {
      context.textBaseline = baseline;
      const text = `${energy.toPrecision(3)} J`;
      context.strokeText(text, 4, y);
      context.fillText(text, 4, y);
    }
  }
}
