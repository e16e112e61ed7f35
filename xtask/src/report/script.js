"use strict";

// Two pictures on top of each other; the slider moves the border between them.
for (const wipe of document.querySelectorAll(".wipe")) {
  const [left, right] = wipe.querySelectorAll("select");
  const stage = wipe.querySelector(".stage");
  const [under, over] = stage.querySelectorAll("img");
  const slider = wipe.querySelector(".slider");
  const show = (image, select) => {
    image.src = select.value;
    image.alt = select.selectedOptions[0].textContent;
  };
  const update = () => {
    stage.style.setProperty("--place", slider.value + "%");
    slider.setAttribute(
      "aria-valuetext",
      `${slider.value} % ${under.alt}, the rest ${over.alt}`,
    );
  };
  left.addEventListener("change", () => { show(under, left); update(); });
  right.addEventListener("change", () => { show(over, right); update(); });
  slider.addEventListener("input", update);
  // Dragging over the picture itself does the same.
  const drag = (event) => {
    if (event.buttons !== 1) return;
    const box = stage.getBoundingClientRect();
    slider.value = String(100 * (event.clientX - box.left) / box.width);
    update();
    event.preventDefault();
  };
  stage.addEventListener("pointerdown", drag);
  stage.addEventListener("pointermove", drag);
  update();
}

// Pictures shown larger than they are keep their pixels apart.
const sharpen = (image) => {
  image.classList.toggle("enlarged", image.naturalWidth > 0 && image.naturalWidth < image.clientWidth);
};
for (const image of document.querySelectorAll(".output img")) {
  image.addEventListener("load", () => sharpen(image));
  if (image.complete) sharpen(image);
}

const filter = document.querySelector("#only-differing");
filter.addEventListener("change", () => document.body.classList.toggle("only-differing", filter.checked));

// A link to a closed output opens it.
const reveal = () => {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (target instanceof HTMLDetailsElement) target.open = true;
};
addEventListener("hashchange", reveal);
reveal();

// Paper cannot be unfolded.
addEventListener("beforeprint", () => {
  for (const output of document.querySelectorAll("details.output")) output.open = true;
  for (const image of document.querySelectorAll("img[loading]")) image.loading = "eager";
});

document.documentElement.dataset.ready = "true";
