// Questions to the server, which keeps nothing: each holds all that its answer needs.

async function answer(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Error("The server does not answer. Is it still running?");
  }
  if (response.ok) return response;
  const { error } = await response.json().catch(() => ({})); // none, if not this server answers
  throw new Error(error ?? `The server does not answer as it should (status ${response.status}).`, { cause: response.status });
}

const json = async (path, options) => (await answer(path, options)).json();

export const begin = () => json("/api");

export const ask = (question, body) =>
  json(`/api/${question}`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });

// A file, and its name without the ending.
export const read = (file, name, unit) =>
  json(`/api/read?${new URLSearchParams({ name, unit })}`, { method: "POST", body: file });

// A home of Sweet Home 3D: a new one of the room; or the one that it was read from, by that name, with others of its
// rooms. `left` is a line on the others that it is saved without, and `without` has their places among these.
export async function home(room, others, file, name = "") {
  const body = new Blob([`${JSON.stringify({ room, others })}\n`, file ?? ""]);
  const response = await answer(`/api/home?${new URLSearchParams({ name })}`, { method: "POST", body });
  const [left, without] = JSON.parse(response.headers.get("Layoutrl-Left") ?? '["", []]');
  return { content: await response.blob(), left, without };
}
