// Writes the lines of the first row of CHOICES that has the answers.
const form = document.getElementById("choose");
const lines = document.getElementById("choose-lines");  // the button that copies gives it another id
const any = (cell) => cell[0] === "any";
const linesOf = (given) =>
  CHOICES.rows.find((row) => row.answers.every((cell, k) => any(cell) || cell.includes(given[k]))).lines;

function answer() {
  const given = CHOICES.questions.map((_, k) => form.elements[`question-${k}`].value);
  lines.textContent = linesOf(given).join("\n") + "\n";
}

CHOICES.questions.forEach(({ text, answers }, k) => {
  const field = document.createElement("fieldset"), legend = document.createElement("legend");
  legend.textContent = text;
  field.append(legend);
  const [usual] = answers.find(([word]) => word === "other") || answers[0];
  answers.forEach(([word, meaning]) => {
    const label = document.createElement("label"), button = document.createElement("input");
    Object.assign(button, { type: "radio", name: `question-${k}`, value: word, checked: word === usual });
    const name = document.createElement("b");
    name.textContent = word;
    label.append(button, name, `: ${meaning}`);
    field.append(label);
  });
  form.append(field);
});
form.addEventListener("change", answer);
form.parentElement.hidden = false;
answer();
