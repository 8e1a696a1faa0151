'use strict';
// Charts of a page. Each <figure class="chart"> has its data in a script element, whose `kind` is a
// function of diagrams.js, an empty <ul class="values"> for its legend and an empty <div class="drawing">.

const Charts = (() => {
  const CONFIG = {
    displaylogo: false,
    showTips: false,
    responsive: true,
    modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d'],
  };
  const drawn = new Map(); // charts by their elements

  /** The same content with colours for their names. */
  function coloured(content, style) {
    if (typeof content === 'string') return content.startsWith('--') ? style.getPropertyValue(content).trim() : content;
    if (Array.isArray(content)) return typeof content[1] === 'number' ? content : content.map((part) => coloured(part, style));
    if (content === null || typeof content !== 'object') return content;
    return Object.fromEntries(Object.entries(content).map(([name, part]) => [name, coloured(part, style)]));
  }

  /** A text that plotly does not read as HTML. */
  function escaped(text) {
    return text.replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/>/g, '&gt;');
  }

  /** A number with at most so many digits. */
  function shown(number, digits = 6) {
    if (!Number.isFinite(number)) return '–';
    const rounded = Number(number.toPrecision(digits));
    const far = rounded !== 0 && (Math.abs(rounded) < 1e-4 || Math.abs(rounded) >= 1e7);
    return (far ? rounded.toExponential().replace('e+', 'e') : String(rounded)).replace(/-/g, '\u2212');
  }

  function axis(own) {
    const lines = { gridcolor: '--grid', zerolinecolor: '--grid', linecolor: '--grid' };
    const title = { ...own.title, text: escaped(own.title?.text ?? ''), standoff: 6 };
    return { ...lines, exponentformat: 'power', automargin: true, nticks: 6, ...own, title };
  }

  function layout(own) {
    const axes = Object.entries(own).filter(([name]) => /^[xy]axis/.test(name));
    return {
      margin: { l: 8, r: 12, t: 12, b: 8 },
      showlegend: false,
      hovermode: 'closest',
      separators: '.\u202f', // decimal point, and a narrow space between thousands
      // on a touch screen a finger on a chart scrolls the page
      dragmode: matchMedia('(pointer: coarse)').matches ? false : 'zoom',
      font: { color: '--ink', size: 12 },
      paper_bgcolor: '--paper',
      plot_bgcolor: '--paper',
      hoverlabel: { bgcolor: '--panel', bordercolor: '--muted', align: 'left', font: { color: '--ink' } },
      modebar: { bgcolor: 'rgba(0,0,0,0)', color: '--reference', activecolor: '--ink' },
      ...own,
      ...Object.fromEntries(axes.map(([name, one]) => [name, axis(one)])),
    };
  }

  function trace(own) {
    const name = escaped(own.name ?? '');
    const line = name && own.type !== 'heatmap' ? `${name}<br>` : '';
    return { hovertemplate: `${line}%{x:.5~g}, %{y:.5~g}<extra></extra>`, ...own, name };
  }

  /** The names of the traces, each with a piece of its line or with its marker. */
  function legend(list, traces) {
    if (!list) return;
    const named = traces.filter((one) => one.name && one.showlegend !== false);
    list.replaceChildren(...named.map((one) => {
      const item = document.createElement('li');
      item.append(swatch(one), one.name.replace(/(?<![\w.-])-(?=\d)/g, '\u2212'));
      return item;
    }));
  }

  function swatch({ mode = 'lines', type, line, marker }) {
    const picture = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
    const shape = document.createElementNS(picture.namespaceURI, 'path');
    picture.setAttribute('class', 'swatch');
    picture.setAttribute('viewBox', '0 0 22 6');
    picture.setAttribute('aria-hidden', 'true');
    const lines = mode.includes('lines') && type !== 'bar';
    shape.setAttribute('d', lines ? 'M0 3H22' : 'M8 3H14');
    shape.setAttribute('style', `stroke: ${(lines ? line?.color : marker?.color) ?? 'currentColor'}; stroke-width: ${lines ? 3 : 6}`);
    shape.setAttribute('stroke-dasharray', lines ? (line?.dash ?? '').replace(/px|solid/g, '') : '');
    picture.append(shape);
    return picture;
  }

  /** Draw a chart, { traces, layout }, into an element with a legend beside it, if there is one. */
  async function draw(element, chart) {
    const plotly = await plotlyReady;
    drawn.set(element, chart);
    const style = getComputedStyle(document.documentElement);
    const parts = [chart.traces.map(trace), layout(chart.layout)];
    const list = element.parentElement.querySelector('.values');
    legend(list, chart.traces.map((one) => coloured(one, style)));
    await plotly.react(element, ...coloured(parts, style), CONFIG);
    // what the library measures texts with is none for readers
    document.getElementById('js-plotly-tester')?.setAttribute('aria-hidden', 'true');
  }

  async function redraw() {
    for (const [element, chart] of drawn) {
      if (element.isConnected) await draw(element, chart);
      else drawn.delete(element);
    }
  }

  async function start() {
    await plotlyReady; // diagrams.js needs this object, which is complete by then
    for (const figure of document.querySelectorAll('figure.chart')) {
      const data = JSON.parse(figure.querySelector('script').textContent);
      await draw(figure.querySelector('.drawing'), Diagrams[data.kind](data));
    }
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
    document.documentElement.dataset.charts = 'yes';
    // other scripts draw on some pages, and say themselves when they are ready
    if (!document.querySelector('#run, #campaign')) document.documentElement.dataset.ready = 'yes';
  }

  return { draw, shown, escaped, ready: start() };
})();
