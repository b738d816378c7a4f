// Which looks the graphics card holds: as many as have room. Another one takes the place of the one that was chosen
// longest ago.
const makeLookMemory = (renderer, mostBytes) => {
  const held = new Map();  // bytes of looks by their numbers, the one chosen last at the end
  let most = mostBytes, queue = Promise.resolve();
  const bytes = () => [...held.values()].reduce((sum, size) => sum + size, 0);
  const use = (k) => {
    const size = held.get(k);
    if (held.delete(k)) held.set(k, size);
  };
  const loadNow = async (k, mayGo) => {
    if (held.has(k)) return true;
    const size = await renderer.sizeOfLook(k);
    for (;;) {
      if (!held.size || bytes() + size <= most) {
        if (await renderer.loadLook(k)) return Boolean(held.set(k, size));
        most = bytes() + size - 1;  // the graphics card has no room for so much
      }
      const oldest = [...held.keys()].find(mayGo);
      if (oldest === undefined) return false;
      renderer.dropLook(oldest);
      held.delete(oldest);
    }
  };
  // Resolves to whether a look is held, after those that were asked for before; mayGo(k) is whether another may go.
  const load = (k, mayGo = () => false) => {
    const turn = queue.then(() => loadNow(k, mayGo));
    queue = turn.catch(() => {});
    return turn;
  };
  return { load, use, bytes, count: () => held.size };
};
