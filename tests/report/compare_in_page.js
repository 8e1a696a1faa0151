// What tests of tests/report/test_cursor.py run in a page of a run: files that are dropped on it.

/** Drop a file; returns the notice, once it is there. */
async function drop(name, text) {
  const data = new DataTransfer();
  data.items.add(new File([text], name));
  document.dispatchEvent(new DragEvent('drop', { dataTransfer: data, bubbles: true, cancelable: true }));
  for (let i = 0; i < 6000 && !page.notice.textContent; i++) await new Promise((next) => { setTimeout(next, 10); });
  const said = page.notice.textContent;
  page.notice.textContent = '';
  return said;
}

/** Compare with rows (time, value) of q1; the notice, and what is then drawn at the times of the run. */
async function compared(rows) {
  const said = await drop('a line.csv', `time;"q1"\r\n${rows.map((row) => row.join(';')).join('\r\n')}\r\n`);
  const { curves: [curve], title } = page.plots[0].plot;
  const { values, other, difference } = curve;
  return { said, title, times: page.x, values, other, difference, traces: page.plots[0].drawing.data?.length };
}
