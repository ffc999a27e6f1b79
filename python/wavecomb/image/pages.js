// SPDX-License-Identifier: Apache-2.0
"use strict";

// A sequence: its sheet of pictures is played in one large one.
for (const player of document.querySelectorAll(".player")) {
  const images = [...document.querySelectorAll(".sheet img")];
  const big = player.querySelector("img"), slider = player.querySelector("input");
  const button = player.querySelector("button"), speed = player.querySelector("select");
  const label = player.querySelector("output");
  let at = 0, timer = 0;
  const show = (frame) => {
    images[at].parentElement.classList.remove("here");
    at = (frame + images.length) % images.length;
    images[at].parentElement.classList.add("here");
    big.src = images[at].src;
    big.alt = label.textContent = images[at].alt;
    slider.value = at;
  };
  const play = (on) => {
    clearInterval(timer);
    timer = on ? setInterval(() => show(at + 1), 1000 / Number(speed.value)) : 0;
    button.textContent = on ? "Pause" : "Play";
  };
  button.onclick = () => play(!timer);
  speed.onchange = () => play(Boolean(timer));
  slider.oninput = () => { play(false); show(Number(slider.value)); };
  images.forEach((image, frame) => { image.parentElement.onclick = () => { play(false); show(frame); big.scrollIntoView({block: "nearest"}); }; });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("select, input")) return;
    const steps = {ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: images.length - 1};
    if (event.key === " ") { if (event.target !== button) play(!timer); else return; }
    else if (event.key in steps) { play(false); show(steps[event.key]); }
    else return;
    event.preventDefault();
  });
  player.hidden = false;
  show(0);
}

// Two pictures and their difference: one place, a line between them that follows the pointer.
for (const views of document.querySelectorAll(".views")) {
  const [a, b, difference] = views.querySelectorAll("img");
  const names = [...views.querySelectorAll("figcaption")].map((one) => one.textContent);
  const box = document.createElement("div");
  const stage = document.createElement("div");
  const controls = document.createElement("div");
  stage.className = "stage";
  controls.className = "controls";
  stage.append(a.cloneNode(), b.cloneNode());
  const [under, over] = stage.children;
  const slider = Object.assign(document.createElement("input"), {type: "range", min: 0, max: 100, step: 0.1, value: 50});
  slider.setAttribute("aria-label", "Where the line is");
  const set = document.createElement("fieldset");
  const place = (share) => { stage.style.setProperty("--at", `${share}%`); slider.value = share; };
  const show = (mode) => {
    const source = {b, difference}[mode] || a;
    stage.classList.toggle("one", mode !== "wipe");
    slider.disabled = mode !== "wipe";
    under.src = a.src;
    over.src = mode === "wipe" ? b.src : source.src;
    stage.setAttribute("aria-label", mode);
    set.querySelector(`[value=${mode}]`).checked = true;
  };
  const modes = [["wipe", "wipe"], ["a", names[0]], ["b", names[1]], ["difference", "difference"]];
  for (const [value, text] of modes.slice(0, difference ? 4 : 3)) {
    const label = document.createElement("label");
    const radio = Object.assign(document.createElement("input"), {type: "radio", value, name: `mode-${views.id}`});
    radio.onchange = () => show(value);
    label.append(radio, text);
    set.append(label);
  }
  stage.onpointermove = (event) => {
    if (stage.classList.contains("one")) return;
    const frame = stage.getBoundingClientRect();
    place(Math.min(Math.max((100 * (event.clientX - frame.left)) / frame.width, 0), 100));
  };
  slider.oninput = () => place(Number(slider.value));
  box.tabIndex = 0;
  box.setAttribute("role", "group");
  box.onkeydown = (event) => {
    const mode = {w: "wipe", a: "a", b: "b", d: "difference"}[event.key];
    if (mode && set.querySelector(`[value=${mode}]`)) show(mode);
  };
  controls.append(set, slider);
  box.append(stage, controls);
  views.before(box);
  views.hidden = true;
  show("wipe");
}
