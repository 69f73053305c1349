// Finds the messages that have most words in common with a text; rare words count more.
const words = (text) => text.toLowerCase().match(/[a-z]{2,}/g) || [];
const commonness = new Map();
const entries = MESSAGES.map(([target, text, kind]) => ({ target, text, kind, words: new Set(words(text)) }));
for (const entry of entries) for (const word of entry.words) commonness.set(word, (commonness.get(word) || 0) + 1);
const weight = (word) => Math.log(1 + entries.length / commonness.get(word));
const field = document.getElementById("message-words");
const list = document.getElementById("message-found");

function find() {
  const given = new Set(words(field.value));
  const scored = entries.map((entry) => {
    let shared = 0, all = 0;
    for (const word of entry.words) {
      all += weight(word);
      if (given.has(word)) shared += weight(word);
    }
    return { entry, score: all ? shared * (shared / all) ** 2 : 0 };
  });
  scored.sort((a, b) => b.score - a.score);
  list.replaceChildren(...scored.slice(0, 6).filter((one) => one.score > 0).map(({ entry }) => {
    const item = document.createElement("li"), link = document.createElement("a");
    link.href = entry.target;
    link.textContent = entry.text;
    item.append(link, ` (${entry.kind})`);
    return item;
  }));
}
field.addEventListener("input", find);
