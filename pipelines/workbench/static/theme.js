// Before anything is drawn: the theme that was chosen in this browser, else that of the system.
const kept = (() => { try { return localStorage.getItem("tumbleline-theme"); } catch { return null; } })();
const dark = kept ? kept === "dark" : window.matchMedia("(prefers-color-scheme: dark)").matches;
document.documentElement.dataset.theme = dark ? "dark" : "light";
