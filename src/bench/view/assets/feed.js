// Feed of the server: Server-Sent Events, read by fetch, which reports the reason for a refused stream.

const RETRY_AFTER_MS = 1000;
const MAX_PENDING = 1_000_000; // characters of an event without its end

/// Reads the feed permanently. Calls `onEvent(kind, json)` for each event and `onLost(reason)` at each end of the stream.
export async function read(onEvent, onLost) {
  for (;;) {
    onLost(await readOnce(onEvent));
    await new Promise((resolve) => setTimeout(resolve, RETRY_AFTER_MS));
  }
}

/// Reads one stream; returns the reason for its end.
async function readOnce(onEvent) {
  const lost = "The server of this page does not answer: frhc view has ended, or the network is down.";
  try {
    const response = await fetch("feed", { cache: "no-store" });
    if (!response.ok) return (await response.text()).slice(0, 300) || `The server has refused the feed (${response.status}).`;
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    let pending = "";
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return lost;
      pending += value;
      const events = pending.split("\n\n");
      pending = events.pop();
      for (const event of events) pass(event, onEvent);
      if (pending.length > MAX_PENDING) {
        await reader.cancel();
        return "The server has sent an event without an end.";
      }
    }
  } catch {
    return lost;
  }
}

function pass(event, onEvent) {
  let [kind, text] = ["message", ""];
  for (const line of event.split("\n")) {
    if (line.startsWith("event: ")) kind = line.slice(7);
    else if (line.startsWith("data: ")) text += line.slice(6);
  }
  if (text) onEvent(kind, text);
}
