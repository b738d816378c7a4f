const told = document.querySelector(".told");
for (const point of document.querySelectorAll(".front circle"))
  for (const event of ["pointerenter", "focus", "click"])
    point.addEventListener(event, () => { told.textContent = point.dataset.told; });
