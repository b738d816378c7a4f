const inBlob = (video) => {
  const [kind, words] = video.getAttribute("src").split(";base64,");
  const bytes = Uint8Array.from(atob(words), (letter) => letter.charCodeAt(0));
  video.src = URL.createObjectURL(new Blob([bytes], { type: kind.slice("data:".length) }));
  video.preload = "auto";
};
const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;
for (const stage of document.querySelectorAll(".stage")) {
  const [leader, follower] = stage.querySelectorAll("video");
  stage.querySelectorAll("video").forEach(inBlob);
  if (!follower) {
    if (leader && !isCalm) leader.play().catch(() => {});
    continue;
  }
  stage.classList.add("live");
  leader.controls = follower.controls = false;
  const play = stage.querySelector("button"), seek = stage.querySelector(".seek");
  const compare = stage.querySelector(".compare"), split = stage.querySelector(".split");
  const clock = stage.querySelector("output");
  const together = 0.02;  // seconds the two may be apart
  const follow = () => {
    if (Math.abs(follower.currentTime - leader.currentTime) > together && !follower.seeking)
      follower.currentTime = leader.currentTime;
  };
  const tell = () => {
    if (!leader.duration) return;
    seek.value = leader.currentTime / leader.duration;
    clock.textContent = `${leader.currentTime.toFixed(1)} of ${leader.duration.toFixed(1)} s`;
  };
  const tick = () => {
    tell();
    if (!leader.paused) { follow(); requestAnimationFrame(tick); }
  };
  const start = () => Promise.all([leader.play(), follower.play()]).catch(() => {});
  leader.addEventListener("loadedmetadata", tell);
  leader.addEventListener("play", () => { play.textContent = "Pause"; follower.play().catch(() => {}); tick(); });
  leader.addEventListener("pause", () => { play.textContent = "Play"; follower.pause(); follow(); });
  leader.addEventListener("seeked", () => { follow(); tell(); });
  play.addEventListener("click", () => leader.paused ? start() : leader.pause());
  seek.addEventListener("input", () => {
    leader.pause();
    leader.currentTime = seek.value * (leader.duration || 0);
  });
  split.addEventListener("input", () => compare.style.setProperty("--split", split.value + "%"));
  if (!isCalm) start();
}
