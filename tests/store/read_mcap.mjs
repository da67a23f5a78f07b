// Prints [topic, log time, publish time, fields of a sighting] of every message, as JSON lines.
import { open } from "node:fs/promises";
import { createRequire } from "node:module";

const require = createRequire(process.env.NODE_PACKAGES + "/package.json");
const { McapIndexedReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

const decompressHandlers = await loadDecompressHandlers();
const lines = [];
for (const path of process.argv.slice(2)) {
  const file = await open(path, "r");
  const readable = new FileHandleReadable(file);
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const readers = new Map();
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    if (!readers.has(channel.schemaId)) {
      const schema = reader.schemasById.get(channel.schemaId);
      const definition = parse(new TextDecoder().decode(schema.data), { ros2: true });
      readers.set(channel.schemaId, new MessageReader(definition));
    }
    const value = readers.get(channel.schemaId).readMessage(message.data);
    const seen = [value.door_id, value.state, value.accuracy_open, value.accuracy_closed];
    lines.push(JSON.stringify([channel.topic, String(message.logTime), String(message.publishTime), seen]));
  }
  await file.close();
}
process.stdout.write(lines.join("\n") + "\n");
