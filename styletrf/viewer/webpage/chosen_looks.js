// Which of the two chosen looks are visible, and how they are loaded.
// `chosen` has their numbers a and b, the share of a in their mixture, and the split: left of which share of the width
// b stands alone, or -1. refresh() shows what changed, and report(text) what the page does.
const makeChosenLooks = (chosen, looks, renderer, memory, { refresh, report }) => {
  let visibleA = chosen.a;  // the look that is drawn while the chosen one is loaded
  const isMixed = () => chosen.share < 1 || chosen.split >= 0;
  const visible = () => {
    if (renderer.isLoaded(chosen.a)) visibleA = chosen.a;
    if (!isMixed() || !renderer.isLoaded(chosen.b)) return { a: visibleA, b: visibleA, share: 1, split: -1 };
    return { a: visibleA, b: chosen.b, share: chosen.share, split: chosen.split };
  };
  const withdraw = (k) => {  // a look that has no room
    if (k === chosen.a) Object.assign(chosen, { a: visibleA, b: chosen.b === visibleA ? k : chosen.b });
    else Object.assign(chosen, { share: 1, split: -1 });
  };
  // Loads one of the chosen looks. A look that nobody would see takes no other's place.
  const load = async (k) => {
    const isSeen = () => chosen.a === k || (chosen.b === k && isMixed()), wasSeen = isSeen();
    if (wasSeen) report(`Loading ${looks[k].name} ...`);
    const mayGo = (old) => isSeen() && ![visibleA, chosen.a, isMixed() && chosen.b].includes(old);
    const isLoaded = await memory.load(k, mayGo);
    if (wasSeen && isSeen()) {
      report(isLoaded ? "" : `The graphics card has too little memory for ${looks[k].name} beside what is shown.`);
      if (!isLoaded) withdraw(k);
    }
    refresh();
  };
  const loadChosen = async () => {
    for (const which of ["a", "b"]) if (!renderer.isLoaded(chosen[which])) await load(chosen[which]);
  };
  const show = (changes) => {
    Object.assign(chosen, changes);
    report("");
    refresh();
    loadChosen().catch(refuse);
  };
  const loadFirst = async () => {
    visibleA = chosen.a;  // another one may be chosen meanwhile
    if (!await memory.load(visibleA)) throw new Refusal(NO_ROOM);
  };
  // Loads the chosen looks, and then all that have room, with a pause before each.
  const loadOthers = async (pauseMs) => {
    await loadChosen();
    for (const k of looks.keys()) {
      if (renderer.isLoaded(k)) continue;
      await new Promise((go) => setTimeout(go, pauseMs));
      await memory.load(k);
      refresh();
    }
  };
  return { visible, show, loadFirst, loadOthers };
};
