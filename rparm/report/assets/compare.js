'use strict';
// Another result over the curves of a page: a CSV file that is read here, or what the page brings
// along from rparm/report/overlay.py.

const Compare = (() => {
  /** Why a file cannot be drawn over the curves. */
  class Refused extends Error {}

  const DIGITS = 2e-7; // of a value: a smaller difference may be the rounding of the page's floats
  const EARLY = 1e-9; // s, of rounding

  /** Fields of a line; quotation marks may hold a delimiter. */
  function fields(line, delimiter) {
    const found = [''];
    let quoted = false;
    for (const sign of line) {
      if (sign === '"') quoted = !quoted;
      else if (sign === delimiter && !quoted) found.push('');
      else found[found.length - 1] += sign;
    }
    return found.map((field) => field.trim());
  }

  /** Names of the columns of a text, and its rows of numbers. */
  function parsed(text) {
    const lines = text.replace(/^\ufeff/, '').split(/\r?\n/);
    if (!text.trim()) throw new Refused('is empty');
    const counts = [',', ';', '\t'].map((sign) => [fields(lines[0], sign).length, sign]);
    const [, delimiter] = counts.reduce((most, next) => (next[0] > most[0] ? next : most));
    const names = fields(lines[0], delimiter);
    const time = names.indexOf('time');
    if (time < 0) throw new Refused('has no column time in its first line');
    const rows = [];
    lines.forEach((line, i) => {
      if (i === 0 || !line.trim()) return;
      const row = fields(line, delimiter).map((field) => (field === '' ? NaN : Number(field)));
      const wrong = (what) => new Refused(`line ${i + 1}: ${what}`);
      if (row.length !== names.length) throw wrong(`expected ${names.length} values, found ${row.length}`);
      if (!row.every(Number.isFinite)) throw wrong('expected numbers with a decimal point');
      if (rows.length && !(row[time] > rows.at(-1)[time])) throw wrong('its time is not after the time of the row before');
      rows.push(row);
    });
    if (!rows.length) throw new Refused('has no rows below the names of its columns');
    return { names, rows, times: rows.map((row) => row[time]) };
  }

  /** Values of a column at times: linear between its rows, NaN outside. */
  function resampled(times, values, at) {
    let row = 0;
    return at.map((time) => {
      while (row < times.length - 1 && times[row + 1] <= time + EARLY) row += 1;
      if (Math.abs(times[row] - time) <= EARLY) return values[row];
      if (time < times[row] || row === times.length - 1) return NaN;
      return values[row] + ((values[row + 1] - values[row]) * (time - times[row])) / (times[row + 1] - times[row]);
    });
  }

  /** Lay a file over the curves of its columns; what `described` needs. Throws a Refused. */
  function over(data, name, text) {
    const { names, rows, times } = parsed(text);
    const curves = data.plots.flatMap((plot) => plot.curves).filter((curve) => names.includes(curve.name));
    if (!curves.length) throw new Refused('has no column with the name of a variable that is plotted');
    if (!data.time.some((time) => time >= times[0] - EARLY && time <= times.at(-1) + EARLY)) {
      throw new Refused('has no time of this run');
    }
    alone(data);
    const known = new Set(times);
    const inside = data.time.filter((time) => time >= times[0] && time <= times.at(-1));
    const both = [...data.time.keys()].filter((i) => known.has(data.time[i]));
    const isThinned = 2 * both.length >= Math.min(times.length, inside.length); // some rows of such a run
    for (const curve of curves) {
      const column = rows.map((row) => row[names.indexOf(curve.name)]);
      curve.other = resampled(times, column, data.time);
      curve.difference = curve.values.map((value, i) => {
        const left = value - curve.other[i];
        return Math.abs(left) <= DIGITS * Math.abs(value) ? 0 : left;
      });
      if (isThinned) { // elsewhere they differ by what is between the rows
        const at = both.map((i) => data.time[i]), left = both.map((i) => curve.difference[i]);
        curve.difference = resampled(at, left, data.time);
      }
    }
    return { name, between: both.length < inside.length };
  }

  /** Take what is laid over the curves away. */
  function alone(data) {
    for (const curve of data.plots.flatMap((plot) => plot.curves)) {
      delete curve.other;
      delete curve.difference;
    }
    return null;
  }

  /** Short name of it: of a file, or of the folder where a command wrote it as it did this run's. */
  function label({ name }) {
    const parts = name.split(/[\\/]/);
    const own = decodeURIComponent(document.querySelector('.facts a')?.getAttribute('href') ?? '');
    if (parts.at(-1) !== own) return parts.at(-1);
    const folders = parts.slice(0, -1).filter((part) => !['scenarios', 'files', 'system', ''].includes(part));
    return folders.at(-1) ?? own;
  }

  /** What readers need to know of it. `scaled` and `shown` are those of plots.js. */
  function described({ other, plots }, scaled, shown) {
    const largest = new Map();
    for (const plot of plots) {
      for (const { name, difference } of plot.curves) {
        if (!difference) continue;
        const most = difference.reduce((size, x) => (Math.abs(x) > size ? Math.abs(x) : size), 0);
        if (!most) continue;
        const { unit, factor } = scaled(plot.unit, [most]);
        largest.set(name, `${name} ${shown(most / factor, 3)}${unit ? `\u00a0${unit}` : ''}`);
      }
    }
    const between = other.between
      ? ' Its times differ: its values are interpolated linearly at the times of this run.' : '';
    return `Dashed: ${other.name}. Below the curves (\u0394): this run less that, at most `
      + `${[...largest.values()].join(', ') || 0}.${between}`;
  }

  return { Refused, over, alone, label, described };
})();
