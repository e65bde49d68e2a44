// Colours and fonts of a figure: those of the page that it stands in, be it a page of the workbench or a report.
// "role:before" and "role:before:0.2" (with its opacity) in the colours of the theme
export function themed(value, style) {
  if (typeof value === "string" && value.startsWith("role:")) {
    const [, role, opacity] = value.split(":");
    const colour = style.getPropertyValue(`--role-${role}`).trim();
    return opacity ? colour + Math.round(255 * Number(opacity)).toString(16).padStart(2, "0") : colour;
  }
  if (Array.isArray(value)) return value.map((one) => themed(one, style));
  if (value && typeof value === "object" && !ArrayBuffer.isView(value)) {
    return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, key === "bdata" ? one : themed(one, style)]));
  }
  return value;
}

// below this width plots stand one under the other
const NARROW = matchMedia("(max-width: 600px)");
export const arranged = (figure) => (NARROW.matches && figure.narrow) || figure.layout;
export const rearranged = (draw) => NARROW.addEventListener("change", draw);

export function dressed(layout, style) {
  const grid = style.getPropertyValue("--grid").trim(), text = style.getPropertyValue("--text").trim();
  const out = { ...themed(layout, style), paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", uirevision: "kept",
    font: { family: getComputedStyle(document.body).fontFamily, size: 13, color: text },
    hoverlabel: { bgcolor: style.getPropertyValue("--panel").trim(), bordercolor: style.getPropertyValue("--line").trim(), font: { color: text } },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: style.getPropertyValue("--quiet").trim(), activecolor: text, orientation: "h" } };
  for (const [name, axis] of Object.entries(out)) if (/^[xy]axis\d*$/.test(name)) out[name] = { ...axis, gridcolor: grid, linecolor: grid, tickcolor: grid };
  return out;
}
