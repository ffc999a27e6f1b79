// SPDX-License-Identifier: Apache-2.0
// Viewers of pictures: A and B on one canvas, and their difference times a gain. Without scripts the
// pictures stand side by side.
"use strict";

for (const viewer of document.querySelectorAll(".viewer")) {
  const pictures = [...viewer.querySelectorAll(".sources img")];
  const canvas = viewer.querySelector("canvas");
  const [a, b] = viewer.querySelectorAll("select");
  const gain = viewer.querySelector("input[type=range]");
  const modes = [...viewer.querySelectorAll("input[type=radio]")];
  const shown = viewer.querySelector(".shown");
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const name = (select) => select.options[select.selectedIndex].text;

  const pixels = (select) => {
    context.drawImage(pictures[select.selectedIndex], 0, 0, canvas.width, canvas.height);
    return context.getImageData(0, 0, canvas.width, canvas.height);
  };

  const draw = () => {
    const mode = modes.find((input) => input.checked).value;
    const factor = 2 ** Number(gain.value);
    viewer.querySelector("output").textContent = `×${factor}`;
    let text = `A: ${name(a)}`;
    if (mode === "difference") {
      const one = pixels(a);
      const two = pixels(b);
      let largest = 0;
      for (let k = 0; k < one.data.length; k++) {
        if (k % 4 === 3) continue;
        const difference = Math.abs(one.data[k] - two.data[k]);
        largest = Math.max(largest, difference);
        one.data[k] = Math.min(255, difference * factor);
      }
      context.putImageData(one, 0, 0);
      text = `|A − B| ×${factor}: ${name(a)} − ${name(b)}; largest difference ${largest} of 255`;
    } else {
      if (mode === "b") text = `B: ${name(b)}`;
      pixels(mode === "b" ? b : a);
    }
    shown.textContent = text;
    canvas.setAttribute("aria-label", text);
  };

  const choose = (mode) => {
    modes.find((input) => input.value === mode).checked = true;
    draw();
  };
  const flip = () => choose(modes.find((input) => input.checked).value === "a" ? "b" : "a");

  canvas.addEventListener("click", flip);
  canvas.addEventListener("keydown", (event) => {
    if (event.key === " " || event.key === "Enter") flip();
    else if (event.key === "d") choose("difference");
    else if (event.key === "a" || event.key === "b") choose(event.key);
    else return;
    event.preventDefault();
  });
  for (const control of [a, b, gain, ...modes]) control.addEventListener("input", draw);

  Promise.all(pictures.map((picture) => picture.decode())).then(() => {
    canvas.width = pictures[0].naturalWidth;
    canvas.height = pictures[0].naturalHeight;
    for (const part of viewer.querySelectorAll("[hidden]")) part.hidden = false;
    draw();
  });
}
