const filter = document.querySelector("#filter");
const rows = [...document.querySelectorAll("#cases tbody tr")];
const shown = document.querySelector("#shown");
function apply() {
  const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
  let count = 0;
  for (const row of rows) {
    const text = row.textContent.toLowerCase();
    row.hidden = !words.every((word) => text.includes(word));
    count += row.hidden ? 0 : 1;
  }
  shown.textContent = `${count} of ${rows.length}`;
}
filter.addEventListener("input", apply);
apply();
document.documentElement.dataset.ready = "true";
