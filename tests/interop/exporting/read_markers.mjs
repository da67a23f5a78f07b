// Reads bags as Foxglove and Lichtblick do: the last message of each topic at some moments.
// Arguments: a file, then moments in ns; "all" decodes every message instead and counts them.
import { open } from "node:fs/promises";
import { createRequire } from "node:module";

const require = createRequire(process.env.NODE_PACKAGES + "/package.json");
const { McapIndexedReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

const [path, ...moments] = process.argv.slice(2);
const readable = new FileHandleReadable(await open(path, "r"));
const decompressHandlers = await loadDecompressHandlers();
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const channels = [...reader.channelsById.values()];
const decoders = new Map(channels.map((channel) => {
  const schema = reader.schemasById.get(channel.schemaId);
  const definition = parse(new TextDecoder().decode(schema.data), { ros2: true });
  return [channel.id, new MessageReader(definition)];
}));
const decoded = (message) => decoders.get(message.channelId).readMessage(message.data);
const plain = (_, value) => (ArrayBuffer.isView(value) ? value.length : value);

if (moments[0] === "all") {
  const counts = {};
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    decoded(message);
    const { topic } = reader.channelsById.get(message.channelId);
    counts[topic] = (counts[topic] ?? 0) + 1;
  }
  console.log(JSON.stringify(counts));
} else {
  for (const moment of moments) {
    const last = {};
    for (const { topic } of channels) {
      const back = { endTime: BigInt(moment), topics: [topic], reverse: true };
      for await (const message of reader.readMessages(back)) {
        last[topic] = decoded(message);
        break;
      }
    }
    console.log(JSON.stringify(last, plain));
  }
}
