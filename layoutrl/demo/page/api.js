// Questions to the server, which keeps nothing: each holds all that its answer needs.

async function answer(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Error("The server does not answer. Is it still running?");
  }
  if (!response.ok) throw new Error((await response.json()).error);
  return response;
}

const json = async (path, options) => (await answer(path, options)).json();

export const begin = () => json("/api");

export const ask = (question, body) =>
  json(`/api/${question}`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  });

export const read = (file) => json("/api/read", { method: "POST", body: file });

// A home of Sweet Home 3D: a new one of the room; or the one that it was read from, with others of its rooms.
export const home = async (room, others, file) =>
  (await answer("/api/home", { method: "POST", body: new Blob([`${JSON.stringify({ room, others })}\n`, file ?? ""]) })).blob();
