// Questions to the server, which keeps nothing: each holds all that its answer needs.

async function answer(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Error("The server does not answer. Is it still running?");
  }
  const said = await response.json();
  if (!response.ok) throw new Error(said.error);
  return said;
}

export const begin = () => answer("/api");

export const ask = (question, body) =>
  answer(`/api/${question}`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });

export const read = (file) => answer("/api/read", { method: "POST", body: file });
