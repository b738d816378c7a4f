// What a server of `styletrf view` adds to the page: styles as they are done, and paths that it saves.
const POLL_MS = 2000;

const answerOf = async (place, options) => {
  const response = await fetch(place, options), found = await response.json().catch(() => ({}));
  if (!response.ok) throw new Error(found.problem ?? `The server refused it (${response.status}).`);
  return found;
};

// addLook(values) is called with each look that the server has and the page has not.
const followServer = async (scene, addLook) => {
  const report = (text) => { $("server").hidden = !text; $("server").textContent = text; };
  for (;;) {
    try {
      const state = await answerOf("state");
      for (let k = scene.looks.length; k < state.looks; k++) {
        const { values, blocks } = await answerOf(`looks/${k}`);
        for (const [id, content] of Object.entries(blocks)) {
          if (document.getElementById(id)) continue;
          const block = document.createElement("script");
          Object.assign(block, { type: "text/plain", id, textContent: content });
          document.body.append(block);
        }
        await addLook(values);
      }
      report(state.report);
    } catch (error) {
      if (error instanceof Refusal) throw error;
      report("The server does not answer. The page goes on with what it has.");
    }
    await new Promise((go) => setTimeout(go, POLL_MS));
  }
};

// chosen(): the looks and the share of the first, of which the server makes the command.
const offerSaving = (editor, chosen) => {
  $("savePath").hidden = false;
  $("savePath").addEventListener("click", async () => {
    const body = JSON.stringify({ path: editor.file(), seconds: editor.seconds(), ...chosen() });
    try {
      const options = { method: "POST", headers: { "Content-Type": "application/json" }, body };
      const { file, command } = await answerOf("path", options);
      editor.report(`Saved in ${file}. This renders it:`, command);
    } catch (error) {
      editor.report(`Not saved. ${error.message}`);
    }
  });
};
