// Search results: how-tos first, the inside of the program and measurements last.
const ORDER = [
  [/^howto\//, 8],
  [/^(choose|messages\/index)$/, 12],
  [/^limits$/, 13],
  [/^(getting-started|materials|tutorial)$/, 4],
  [/^(units|coming-from|run-faster)$/, 6],
  [/^reference\/generated\/(command|fix|dump|material)\//, 4],
  [/^(messages|gallery)\/generated\//, -6],
  [/^(atlas|balance|comparison|defaults|verification|[\w-]+-measurements|study-verdicts)$/, -8],
  [/^(house|versions)/, -20],
];

// Sphinx takes the best score of any word; each further word in the title counts, too, and a title
// that has all words of a question counts most.
const ASKED = (new URLSearchParams(window.location.search).get("q") || "").toLowerCase();
const ROOTS = ASKED.split(/\W+/).filter((word) => word.length > 2 || /\d/.test(word))
  .map((word) => word.slice(0, Math.max(4, word.length - 2)));
const inTitle = (title) => {
  const words = title.toLowerCase().split(/[^\w]+/);
  const found = ROOTS.filter((root) => words.some((word) => word.startsWith(root))).length;
  return found + 2 * (found > 1 && found === ROOTS.length);
};

var Scorer = {
  score: ([page, title, , , score]) =>
    score + 3 * inTitle(title) +
    ORDER.filter(([names]) => names.test(page)).reduce((sum, [, more]) => sum + more, 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
