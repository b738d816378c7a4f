// Videos: made where one plays, and gone where none does, so that thousands of tiles have none.
const playAll = document.querySelector(".play-all");
const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;
const canHover = matchMedia("(hover: hover)").matches;

const play = (picture) => {
  const image = picture.querySelector("img[data-video]");
  if (!image || picture.querySelector("video")) return;
  const video = document.createElement("video");
  Object.assign(video, { src: image.dataset.video, muted: true, loop: true, playsInline: true });
  video.setAttribute("aria-hidden", "true");
  video.addEventListener("error", () => video.remove());
  picture.append(video);
  video.play().catch(() => {});
};
const stop = (picture) => picture.querySelector("video")?.remove();
const isPlayingAll = () => playAll?.getAttribute("aria-pressed") === "true";
const onScreen = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries)
    if (!isIntersecting) stop(target);
    else if (isPlayingAll() || (!canHover && !isCalm)) play(target);
}, { threshold: 0.6 });

const pictures = tiles.map(({ tile }) => tile.querySelector(".picture")).filter(Boolean);
const watch = () => {  // again, which plays what is on the screen where all are to play
  for (const picture of pictures) {
    onScreen.unobserve(picture);
    onScreen.observe(picture);
  }
};
if (gallery && !isCalm && canHover)
  for (const [enter, leave] of [["pointerover", "pointerout"], ["focusin", "focusout"]]) {
    const pictureOf = (target) => target?.closest?.(".tile")?.querySelector(".picture");
    gallery.addEventListener(enter, ({ target }) => { const at = pictureOf(target); if (at) play(at); });
    gallery.addEventListener(leave, ({ target, relatedTarget }) => {
      const at = pictureOf(target);
      if (at && at !== pictureOf(relatedTarget) && !isPlayingAll()) stop(at);
    });
  }
playAll?.addEventListener("click", () => {
  playAll.setAttribute("aria-pressed", !isPlayingAll());
  playAll.textContent = isPlayingAll() ? "Stop all" : "Play all";
  pictures.forEach(stop);
  watch();
});
watch();
