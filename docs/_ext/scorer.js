// Search results: how-tos first, the inside of the program and measurements last.
const ORDER = [
  [/^howto\//, 8],
  [/^(choose|messages\/index)$/, 12],
  [/^limits$/, 10],
  [/^(getting-started|materials|units|tutorial)$/, 4],
  [/^reference\/generated\/(command|fix|dump|material)\//, 4],
  [/^(messages|gallery)\/generated\//, -6],
  [/^(atlas|balance|comparison|defaults|verification|[\w-]+-measurements|study-verdicts)$/, -8],
  [/^(house|versions)/, -20],
];

var Scorer = {
  score: ([page, , , , score]) =>
    score + ORDER.filter(([names]) => names.test(page)).reduce((sum, [, more]) => sum + more, 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
