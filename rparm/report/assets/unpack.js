'use strict';
// plotly.js @VERSION@ (MIT license, plotly.com), compressed: its bundle is a third of the report
// otherwise. `plotlyReady` is fulfilled with the library.
const plotlyReady = (async () => {
  const packed = Uint8Array.from(atob('@PACKED@'), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('gzip'));
  const script = document.createElement('script');
  script.src = URL.createObjectURL(
    new Blob([await new Response(stream).arrayBuffer()], { type: 'text/javascript' }),
  );
  await new Promise((loaded, failed) => {
    script.onload = loaded;
    script.onerror = failed;
    document.head.append(script);
  });
  URL.revokeObjectURL(script.src);
  return window.Plotly;
})();
