// One finger moves the cursor, two zoom and pan.
export function listenToFingers(plot, telemetry) {
  const { over } = plot;
  const fingers = new Map();
  let begun;
  const inside = ({ clientX }) => clientX - over.getBoundingClientRect().left;
  over.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "touch") return;
    fingers.set(event.pointerId, inside(event));
    begun = fingers.size === 2 ? { at: [...fingers.values()].map((left) => plot.posToVal(left, "x")) } : undefined;
  });
  over.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    fingers.set(event.pointerId, inside(event));
    const lefts = [...fingers.values()];
    if (!begun) { telemetry.player.pause(); telemetry.goTo(plot.posToVal(lefts[0], "x")); return; }
    // the two places stay under the two fingers
    const scale = (begun.at[1] - begun.at[0]) / ((lefts[1] - lefts[0]) || 1);
    const from = begun.at[0] - lefts[0] * scale;
    telemetry.show(from, from + over.clientWidth * scale);
  });
  for (const end of ["pointerup", "pointercancel"]) over.addEventListener(end, ({ pointerId }) => { fingers.delete(pointerId); begun = undefined; });
}
