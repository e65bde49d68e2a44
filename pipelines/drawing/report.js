// Figures of a report: each stands there as SVG, and is drawn so that it can be zoomed and pointed at when it comes into sight.
let library = null;

function plotly() {
  library ??= (async () => {
    const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), (letter) => letter.charCodeAt(0));
    const text = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
    document.head.append(Object.assign(document.createElement("script"), { textContent: text }));
    if (!window.Plotly) throw new Error("the drawing library did not start");
    return window.Plotly;
  })();
  return library;
}

async function draw(figure) {
  const place = figure.querySelector(".live");
  if (!place.figure) place.figure = JSON.parse(figure.querySelector("script").textContent);
  const drawing = await plotly(), style = getComputedStyle(document.documentElement), { data, config } = place.figure;
  await drawing.react(place, themed(data, style), dressed(arranged(place.figure), style), config);
  figure.classList.add("drawn");
}

// a browser without one of these functions keeps the pictures
if (window.DecompressionStream && window.IntersectionObserver) {
  const seen = new IntersectionObserver((entries) => {
    for (const one of entries) if (one.isIntersecting) { seen.unobserve(one.target); draw(one.target).catch(() => {}); }
  }, { rootMargin: "200px" });
  for (const figure of document.querySelectorAll(".figure")) if (figure.querySelector("script")) seen.observe(figure);
  const again = () => { for (const figure of document.querySelectorAll(".figure.drawn")) draw(figure).catch(() => {}); };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  rearranged(again);
}
