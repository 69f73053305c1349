// Writes the lines of the first row of CHOICES that has the answers.
const form = document.getElementById("choose");
const any = (cell) => cell[0] === "any";
const linesOf = (given) =>
  CHOICES.rows.find((row) => row.answers.every((cell, k) => any(cell) || cell.includes(given[k]))).lines;

function answer() {
  const given = CHOICES.questions.map((_, k) => form.elements[`question-${k}`].value);
  document.getElementById("choose-lines").textContent = linesOf(given).join("\n") + "\n";
}

CHOICES.questions.forEach(({ text, answers }, k) => {
  const field = document.createElement("fieldset"), legend = document.createElement("legend");
  legend.textContent = text;
  field.append(legend);
  answers.forEach(([word, meaning], first) => {
    const label = document.createElement("label"), button = document.createElement("input");
    Object.assign(button, { type: "radio", name: `question-${k}`, value: word, checked: first === 0 });
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
