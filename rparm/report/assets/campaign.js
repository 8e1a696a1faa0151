'use strict';
// The scatter plots of a campaign: a result over each parameter, and the run of a point that is clicked.
//
// <script type="application/json" id="campaign"> has values of runs by column (null: none), the numbers
// of these runs, and for each result the rank correlation and the total Sobol' index of each parameter.

const Campaign = (() => {
  const MOST = 12; // plots
  const data = JSON.parse(document.getElementById('campaign').textContent);
  const result = document.getElementById('result');
  const order = document.getElementById('order');
  const number = document.getElementById('number');
  const chosen = document.getElementById('chosen');
  const scatter = document.getElementById('scatter');

  function element(tag, text, ...children) {
    const made = document.createElement(tag);
    made.textContent = text;
    made.append(...children);
    return made;
  }

  /** Parameters by their numbers, the most important for a result first. */
  function sorted(name) {
    const found = data.results[name];
    const key = found.totals.length && order ? found[order.value] : found.ranks;
    const size = (i) => Math.abs(key[i] ?? 0);
    return data.parameters.map((_, i) => i).sort((i, k) => size(k) - size(i));
  }

  function caption(name, i) {
    const { ranks, totals } = data.results[name];
    const parts = [`rank correlation ${Charts.shown(ranks[i] ?? NaN, 2)}`];
    if (totals.length) parts.push(`total index ${Charts.shown(totals[i], 2)}`);
    return `${data.parameters[i]}: ${parts.join(', ')}`;
  }

  function chart(name, i) {
    const parameter = data.parameters[i];
    const row = data.runs.indexOf(Campaign.run);
    const at = (column) => (row < 0 ? [] : [data.values[column][row]]);
    return {
      traces: [
        {
          x: data.values[parameter],
          y: data.values[name],
          customdata: data.runs,
          mode: 'markers',
          marker: { size: 5, opacity: 0.55, color: '--curve1' },
          hovertemplate: 'run %{customdata}<br>%{x:.5~g}, %{y:.5~g}<extra></extra>',
        },
        {
          x: at(parameter),
          y: at(name),
          mode: 'markers',
          hoverinfo: 'skip',
          hovertemplate: '',
          marker: { size: 14, symbol: 'circle-open', color: '--effort', line: { width: 3, color: '--effort' } },
        },
      ],
      layout: {
        xaxis: { title: { text: data.labels[parameter] } },
        yaxis: { title: { text: data.labels[name] } },
      },
    };
  }

  /** Plots of the chosen result, in their order. */
  async function draw() {
    const name = result.value;
    const shown = sorted(name).slice(0, MOST);
    const figures = shown.map((i) => {
      const figure = element('figure', '', element('figcaption', caption(name, i)), element('div', ''));
      figure.className = 'chart';
      const drawing = figure.lastChild;
      drawing.className = 'drawing';
      drawing.setAttribute('role', 'group');
      drawing.setAttribute('aria-label', `${name} over ${data.parameters[i]}, ${caption(name, i)}`);
      return figure;
    });
    scatter.replaceChildren(...figures);
    if (shown.length < data.parameters.length) {
      scatter.append(element('p', `${data.parameters.length - shown.length} further parameters are not drawn.`));
    }
    for (const [k, i] of shown.entries()) {
      const drawing = figures[k].lastChild;
      await Charts.draw(drawing, chart(name, i));
      drawing.on('plotly_click', pick);
    }
    scatter.dataset.result = name;
  }

  function pick(event) {
    const run = event.points[0].customdata;
    if (Number.isInteger(run)) choose(run);
  }

  /** Show a run: its values where the page has them, and the command that repeats it. */
  async function choose(run) {
    Campaign.run = run;
    number.value = run;
    const row = data.runs.indexOf(run);
    const parts = [element('h3', `Run ${run}`), element('p', '', element('code', `${data.again}${run} --open`))];
    if (row < 0) parts.push(element('p', 'It is not one of the points; its values are in the table of the results.'));
    else {
      const list = element('dl', '');
      for (const [name, values] of Object.entries(data.values)) {
        const pair = element('div', '', element('dt', data.labels[name]), element('dd', Charts.shown(values[row] ?? NaN, 7)));
        list.append(pair);
      }
      parts.push(list);
    }
    chosen.replaceChildren(...parts);
    const name = result.value;
    const shown = sorted(name).slice(0, MOST);
    const drawings = scatter.querySelectorAll('.drawing');
    for (const [k, drawing] of drawings.entries()) await Charts.draw(drawing, chart(name, shown[k]));
    chosen.dataset.run = run;
  }

  async function start() {
    result.append(...Object.keys(data.results).map((name) => new Option(data.labels[name], name)));
    if (data.first) result.value = data.first;
    result.addEventListener('change', draw);
    order?.addEventListener('change', draw);
    number.addEventListener('change', () => {
      if (number.value !== '' && number.checkValidity()) choose(Number(number.value));
    });
    number.form.addEventListener('submit', (event) => event.preventDefault());
    await Charts.ready;
    if (result.options.length) await draw();
    for (const drawing of document.querySelectorAll('.map .drawing')) drawing.on('plotly_click', pick);
    document.documentElement.dataset.ready = 'yes';
  }

  return { ready: start(), run: undefined };
})();
