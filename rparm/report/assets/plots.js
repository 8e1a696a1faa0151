'use strict';
// The plots of a page, and one cursor for all of them and for the player.
//
// The page has the data in <script type="application/json" id="run"> and an empty
// <figure class="plot"> for each plot. Arrays of numbers are {"array": index} into "arrays", which
// holds doubles (f8) or floats (f4) in base64, little-endian.

const Plots = (() => {
  const FEW = 40; // rows; up to here each one gets a marker
  const DASHES = [[], [6, 4], [2, 3], [7, 3, 2, 3]]; // px, drawn and left out
  const COLOURS = 6;

  /** Data of the page, with arrays unpacked. */
  function read(text) {
    const arrays = JSON.parse(text).arrays.map(decode);
    return JSON.parse(text, (_, value) => (value && value.array !== undefined ? arrays[value.array] : value));
  }

  function decode({ f8, f4 }) {
    const bytes = Uint8Array.from(atob(f8 ?? f4), (c) => c.charCodeAt(0));
    const numbers = f8 === undefined ? new Float32Array(bytes.buffer) : new Float64Array(bytes.buffer);
    // a float reads as the shortest number that it stands for, not with the digits of a double
    return Array.from(numbers, f8 === undefined ? (x) => Number(x.toPrecision(7)) : undefined);
  }

  /** Index of the number in `sorted` (ascending or descending) that is nearest to `x`. */
  function nearest(sorted, x) {
    const sign = sorted[sorted.length - 1] >= sorted[0] ? 1 : -1;
    let low = 0;
    let high = sorted.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (sign * sorted[middle] <= sign * x) low = middle;
      else high = middle;
    }
    return Math.abs(sorted[high] - x) < Math.abs(x - sorted[low]) ? high : low;
  }

  /** At most so many digits, as short as they get. */
  function shown(number, digits = 9) {
    if (!Number.isFinite(number)) return '–';
    const rounded = Number(number.toPrecision(digits));
    const tiny = rounded !== 0 && Math.abs(rounded) < 1e-4;
    return minus(tiny ? rounded.toExponential() : String(rounded));
  }

  /** A text with minus signs before its digits, as the axes have them. */
  function minus(text) {
    return text.replace(/(?<![\w.-])-(?=\d)|(?<=\de)-(?=\d)/g, '\u2212');
  }

  function colours() {
    const style = getComputedStyle(document.documentElement);
    const named = (name) => style.getPropertyValue(`--${name}`).trim();
    return {
      ink: named('ink'),
      paper: named('paper'),
      grid: named('grid'),
      reference: named('reference'),
      curves: Array.from({ length: COLOURS }, (_, i) => named(`curve${i + 1}`)),
    };
  }

  /** Colour and dashes of a curve. */
  function styleOf(curve, i, palette) {
    if (curve.limit) return { colour: palette.ink, dashes: DASHES[1] };
    return { colour: palette.curves[i % COLOURS], dashes: DASHES[Math.floor(i / COLOURS) % DASHES.length] };
  }

  /** Traces of plotly: references below, levels dashed, curves on top. */
  function traces(plot, x, palette) {
    const mode = x.length <= FEW ? 'lines+markers' : 'lines';
    const references = plot.curves
      .filter((curve) => curve.reference)
      .map((curve) => ({
        x, y: curve.reference, mode, line: { color: palette.reference, width: 5, simplify: false }, marker: { size: 10 },
      }));
    const levels = (plot.levels ?? []).map((level) => ({
      x: [x[0], x[x.length - 1]],
      y: [level.value, level.value],
      mode: 'lines',
      line: { color: palette.ink, width: 1, dash: 'dash' },
    }));
    // a logarithmic axis has no 0: a gap; a point between two gaps is seen by its marker
    const drawn = (values) => (plot.log ? values.map((value) => (value > 0 ? value : null)) : values);
    const alone = (values) => values.map((value, i) => {
      const beside = values[i - 1] ?? values[i + 1] ?? null;
      return value !== null && beside === null ? 5 : 0;
    });
    const curves = plot.curves.map((curve, i) => {
      const { colour, dashes } = styleOf(curve, i, palette);
      const y = drawn(curve.values);
      const points = x.length > FEW && plot.log ? alone(y) : [];
      return {
        x,
        y,
        mode: points.some(Boolean) ? 'lines+markers' : mode,
        line: {
          color: colour,
          width: curve.limit ? 1 : 1.6,
          simplify: false,
          shape: curve.steps ? 'vh' : 'linear',
          dash: dashes.map((length) => `${length}px`).join() || 'solid',
        },
        marker: { size: points.some(Boolean) ? points : 5 },
      };
    });
    return [...references, ...levels, ...curves];
  }

  function layout(plot, axis, palette) {
    const lines = { gridcolor: palette.grid, zerolinecolor: palette.grid, linecolor: palette.grid };
    return {
      margin: { l: 62, r: 12, t: 26, b: 38 },
      showlegend: false,
      hovermode: false,
      separators: '.\u202f', // decimal point, and a narrow space between thousands
      // on a touch screen a finger on a plot scrolls the page
      dragmode: matchMedia('(pointer: coarse)').matches ? false : 'zoom',
      font: { color: palette.ink, size: 12 },
      paper_bgcolor: palette.paper,
      plot_bgcolor: palette.paper,
      modebar: { bgcolor: 'rgba(0,0,0,0)', color: palette.reference, activecolor: palette.ink },
      xaxis: {
        ...lines,
        title: { text: axis.unit ? `${axis.title} (${axis.unit})` : axis.title, standoff: 4 },
        type: axis.log ? 'log' : 'linear',
        autorange: axis.reversed ? 'reversed' : true,
        exponentformat: axis.log ? 'power' : 'none', // a late time keeps its digits
      },
      yaxis: { ...lines, type: plot.log ? 'log' : 'linear', exponentformat: 'power', nticks: 6 },
    };
  }

  const CONFIG = {
    displaylogo: false,
    showTips: false,
    responsive: true,
    modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d'],
  };

  /** Entries of the legend, which show the values at the cursor too. */
  function entries(list, plot, palette) {
    const entry = (name, { colour, dashes = [] }) => {
      const item = document.createElement('li');
      const value = document.createElement('span');
      item.append(swatch(colour, dashes), `${minus(name)} `, value);
      list.append(item);
      return value;
    };
    const label = (curve, i) => [curve.name, styleOf(curve, i, palette)];
    list.replaceChildren();
    const found = plot.curves.flatMap((curve, i) => {
      const own = { values: curve.values, text: entry(...label(curve, i)) };
      own.text.dataset.curve = curve.name;
      if (!curve.reference) return [own];
      const name = plot.curves.length > 1 ? `reference of ${curve.name}` : 'reference';
      return [own, { values: curve.reference, text: entry(name, { colour: palette.reference }) }];
    });
    for (const level of plot.levels ?? []) entry(level.name, { colour: palette.ink, dashes: DASHES[1] });
    return found;
  }

  /** A piece of a line as the plot has it. */
  function swatch(colour, dashes) {
    const picture = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
    picture.setAttribute('class', 'swatch');
    picture.setAttribute('viewBox', '0 0 22 6');
    picture.setAttribute('aria-hidden', 'true');
    const line = document.createElementNS(picture.namespaceURI, 'path');
    line.setAttribute('d', 'M0 3H22');
    line.setAttribute('stroke', colour);
    line.setAttribute('stroke-dasharray', dashes.join(' '));
    picture.append(line);
    return picture;
  }

  /** One plot: the figure, its drawing, its values at the cursor. */
  class Plot {
    constructor(figure, plot, data) {
      this.figure = figure;
      this.plot = plot;
      this.x = data.time;
      this.axis = data.axis;
      this.drawing = figure.querySelector('.drawing');
      this.line = document.createElement('div');
      this.line.className = 'cursor';
      this.line.hidden = true;
      this.restyle();
    }

    restyle() {
      this.palette = colours();
      this.values = entries(this.figure.querySelector('.values'), this.plot, this.palette);
    }

    async draw(plotly) {
      const parts = [traces(this.plot, this.x, this.palette), layout(this.plot, this.axis, this.palette)];
      await plotly.react(this.drawing, ...parts, CONFIG);
      this.drawing.append(this.line);
      this.place();
    }

    /** Abscissa at a point of the screen; undefined beside the plot. */
    at(event) {
      const { xaxis } = this.drawing._fullLayout;
      const pixel = event.clientX - this.drawing.getBoundingClientRect().left - xaxis._offset;
      return pixel >= 0 && pixel <= xaxis._length ? xaxis.p2d(pixel) : undefined;
    }

    show(row) {
      this.row = row;
      const unit = this.plot.unit ? ` ${this.plot.unit}` : '';
      for (const { values, text } of this.values) text.textContent = shown(values[row]) + unit;
      this.place();
    }

    place() {
      const full = this.drawing._fullLayout;
      if (!full || this.row === undefined) return;
      const pixel = full.xaxis.d2p(this.x[this.row]);
      this.line.hidden = !(pixel >= 0 && pixel <= full.xaxis._length);
      this.line.style.left = `${full.xaxis._offset + pixel}px`;
      this.line.style.top = `${full.yaxis._offset}px`;
      this.line.style.height = `${full.yaxis._length}px`;
    }
  }

  /** The cursor of a page: all plots, the bar, and the player where there is motion. */
  class Page {
    constructor(data) {
      this.data = data;
      this.x = data.time;
      const figures = document.querySelectorAll('figure.plot');
      this.plots = data.plots.map((plot, i) => new Plot(figures[i], plot, data));
      this.bar = document.querySelector('.cursor-bar input');
      this.output = document.querySelector('.cursor-bar output');
      this.bar.max = this.x.length - 1;
      this.bar.addEventListener('input', () => this.seek(Number(this.bar.value)));
      this.addPlayer(document.getElementById('player'));
      this.show(0);
    }

    addPlayer(element) {
      if (!element) return;
      this.player = new Player(element, this.data.motion);
      element.addEventListener('time', (event) => {
        if (!this.seeking) this.show(nearest(this.x, event.detail.time));
      });
    }

    /** Move the cursor to a row, and the player with it. */
    seek(row) {
      this.show(row);
      if (!this.player) return;
      this.seeking = true;
      this.player.seek(this.x[row]);
      this.seeking = false;
    }

    show(row) {
      if (row === this.row) return;
      this.row = row;
      const { title, unit } = this.data.axis;
      const text = `${title} ${shown(this.x[row], 15)}${unit ? ` ${unit}` : ''}`;
      this.bar.value = row;
      this.bar.setAttribute('aria-valuetext', text);
      this.output.textContent = text;
      for (const plot of this.plots) plot.show(row);
    }

    async draw() {
      const plotly = await plotlyReady;
      for (const plot of this.plots) {
        await plot.draw(plotly);
        this.listen(plotly, plot);
      }
      // what the library measures texts with is none for readers
      document.getElementById('js-plotly-tester')?.setAttribute('aria-hidden', 'true');
      const dark = matchMedia('(prefers-color-scheme: dark)');
      dark.addEventListener('change', () => this.restyle(plotly));
      document.documentElement.dataset.ready = 'yes';
    }

    listen(plotly, plot) {
      const seek = (event) => {
        const x = plot.at(event);
        if (x !== undefined) this.seek(nearest(this.x, x));
      };
      plot.drawing.addEventListener('click', seek);
      plot.drawing.addEventListener('mousemove', (event) => {
        // a running animation keeps the cursor
        if (!event.buttons && !this.player?.playing) seek(event);
      });
      plot.drawing.on('plotly_relayout', (change) => this.zoom(plotly, plot, change));
      plot.drawing.on('plotly_afterplot', () => plot.place());
    }

    /** All plots show the same part of the abscissa. */
    zoom(plotly, source, change) {
      if (this.zooming || !Object.keys(change).some((key) => key.startsWith('xaxis'))) return;
      const { xaxis } = source.drawing.layout;
      const update = change['xaxis.autorange']
        ? { 'xaxis.autorange': this.data.axis.reversed ? 'reversed' : true }
        : { 'xaxis.range': [...xaxis.range] };
      this.zooming = true;
      const others = this.plots.filter((plot) => plot !== source);
      Promise.all(others.map((plot) => plotly.relayout(plot.drawing, update))).finally(() => {
        this.zooming = false;
      });
    }

    async restyle(plotly) {
      for (const plot of this.plots) {
        plot.restyle();
        plot.show(this.row);
        await plot.draw(plotly);
      }
    }
  }

  /** Draw the plots of this page; gives the page's cursor. */
  function start() {
    const page = new Page(read(document.getElementById('run').textContent));
    page.ready = page.draw();
    return page;
  }

  return { start, read, nearest };
})();

const page = Plots.start();
