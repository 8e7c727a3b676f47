// Dark and light: the style sheet has the colours, this hands them to the picture.

const COLOURS = {
  clay: "--clay", inside: "--inside", flatColour: "--canvas", ink: "--edge", markColour: "--principal", rim: "--rim",
  dark: "--mirror-dark", light: "--mirror-light",
};

export function wantedScheme() {
  return stored() ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
}

function stored() {
  try { return localStorage.getItem("torchfair scheme"); } catch { return null; }
}

export function applyScheme({ scene, store }) {
  document.documentElement.dataset.scheme = store.scheme;
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(name).trim();
  for (const [uniform, name] of Object.entries(COLOURS)) scene.uniforms[uniform].value.set(colour(name));
  scene.background.set(colour("--canvas"));
  scene.inks = { edge: scene.uniforms.ink.value.clone(), wire: scene.background.clone().set(colour("--wire")) };
  scene.gauss.ink.value = scene.inks.wire;
  const { ballColour, ballRim } = scene.gauss.uniforms;
  ballColour.value = scene.background.clone().set(colour("--ball"));
  ballRim.value = scene.background.clone().set(colour("--ball-rim"));
  scene.marked = Object.fromEntries(["accent", "held", "hover", "crossing"].map((name) => [
    name, scene.background.clone().set(colour(`--${name}`)).toArray()]));
  scene.invalidate();
}

export function keepScheme(scheme) {
  try { localStorage.setItem("torchfair scheme", scheme); } catch { /* no storage: for this time only */ }
}

export const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
