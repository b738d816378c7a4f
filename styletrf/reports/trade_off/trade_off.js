const description = document.querySelector(".description");
for (const point of document.querySelectorAll(".front circle"))
  for (const event of ["pointerenter", "focus", "click"])
    point.addEventListener(event, () => { description.textContent = point.dataset.description; });
