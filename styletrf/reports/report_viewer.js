const walk = document.querySelector(".walk");
if (walk) {
  const there = walk.querySelector(".there"), absent = walk.querySelector(".absent");
  const link = there.querySelector("a"), picture = new Image();
  const offer = () => {  // a click, since a viewer is several megabytes
    const enter = document.createElement("button"), image = new Image(), words = document.createElement("span");
    enter.type = "button";
    enter.className = "enter";
    words.textContent = "Walk around";
    image.src = document.querySelector(".stage video")?.poster || document.querySelector(".stage img")?.src || picture.src;
    image.alt = "";
    enter.append(image, words);
    enter.addEventListener("click", () => {
      const frame = document.createElement("iframe");
      Object.assign(frame, { src: link.href, title: "Viewer", allow: "fullscreen" });
      enter.replaceWith(frame);
      frame.focus();
    });
    there.before(enter);
    there.replaceChildren(link);
    absent.hidden = true;
  };
  picture.addEventListener("load", offer);
  picture.addEventListener("error", () => { there.hidden = true; });
  picture.src = walk.dataset.picture;
}
