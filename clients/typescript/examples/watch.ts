// Lets snow fall on a new session and watches it settle: node examples/watch.ts [url]
import { Firn } from "../src/index.ts";

const firn = new Firn(process.argv[2] ?? "http://127.0.0.1:8080");
const { id } = await firn.createSession({ grid: { width: 32, depth: 32, height: 40 }, time_scale: 10 });
const session = firn.session(id);
const stream = session.stream({ onState: (state) => console.log("stream:", state.name) });
stream.subscribe({ max_rate: 2 }, ({ tick, tiles, field }) => {
  console.log(`tick ${tick}: ${tiles.length} tiles, ${field.heights[0]?.toFixed(3)} m at the origin`);
});
await session.snowfall({ depth: 6 });
await new Promise((resolve) => setTimeout(resolve, 3000));
stream.close();
await session.delete();
