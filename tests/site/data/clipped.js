() => {
  const told = [];
  const shown = (one) => one.outerHTML.slice(0, 80);
  const scrolls = (one) => one.closest(".wide, .command, svg, canvas, details:not([open])");
  for (const one of document.body.querySelectorAll("*")) {
    const box = one.getBoundingClientRect();
    const outside = box.right > innerWidth + 1 || box.left < -1;
    if (box.width && outside && !scrolls(one)) told.push(shown(one));
    const hides = getComputedStyle(one).overflowX === "hidden";
    if (hides && one.scrollWidth > one.clientWidth + 1) told.push("hidden: " + shown(one));
  }
  for (const text of document.querySelectorAll("figure svg text")) {
    const frame = text.ownerSVGElement.getBoundingClientRect(), box = text.getBoundingClientRect();
    const across = box.left < frame.left - 1 || box.right > frame.right + 1;
    const along = box.top < frame.top - 1 || box.bottom > frame.bottom + 1;
    if (box.width && (across || along)) told.push("text: " + text.textContent);
  }
  return told;
}
