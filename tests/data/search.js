// Search a built site for questions, as its page of search does: node search.js SITE QUESTION ...
// Prints the first page of each.
const fs = require("fs");
const vm = require("vm");
const [site, ...questions] = process.argv.slice(2);
const document = {
  documentElement: { dataset: {} }, querySelectorAll: () => [], addEventListener() {},
  getElementById: () => ({}),
};
const files = ["_static/language_data.js", "_static/searchtools.js", "searchindex.js"];
for (const question of questions) {
  const window = { location: { search: "?" + new URLSearchParams({ q: question }) } };
  const globals = { window, document, URLSearchParams, SPHINX_HIGHLIGHT_ENABLED: false };
  const context = vm.createContext({ ...globals, DOCUMENTATION_OPTIONS: {}, _ready() {} });
  for (const file of files) {
    if (file.includes("searchtools")) vm.runInContext("var Stemmer = window.Stemmer", context);
    vm.runInContext(fs.readFileSync(`${site}/${file}`, "utf8"), context);
  }
  context.question = question;
  const found = vm.runInContext(
    "Search._performSearch(...Search._parseQuery(question))", context);
  console.log(found.length ? found.at(-1)[0] : "nothing");
}
