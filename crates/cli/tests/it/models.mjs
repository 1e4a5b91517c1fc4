// Runs the published graph of a detector in TensorFlow.js, for which it was published: FOLDER INPUT OUTPUT, the last two as 32-bit floats.
import * as fs from "node:fs";
import "@tensorflow/tfjs-backend-cpu";
import { loadGraphModel } from "@tensorflow/tfjs-converter";
import * as tf from "@tensorflow/tfjs-core";

const [folder, input, output] = process.argv.slice(2);
const bytes = (file) => {
  const read = fs.readFileSync(file);
  return read.buffer.slice(read.byteOffset, read.byteOffset + read.length);
};
const graph = JSON.parse(fs.readFileSync(`${folder}/nanodet.json`));
const weightSpecs = graph.weightsManifest.flatMap((part) => part.weights);
await tf.setBackend("cpu");
const load = async () => ({ ...graph, weightSpecs, weightData: bytes(`${folder}/nanodet.bin`) });
const model = await loadGraphModel({ load });
const image = tf.tensor(new Float32Array(bytes(input)), [1, 3, 416, 416]);
const outputs = ["Identity:0", "Identity_1:0", "Identity_2:0", "Identity_3:0", "Identity_4:0", "Identity_5:0"];
const values = model.execute({ "input_1:0": image }, outputs).map((tensor) => Buffer.from(tensor.dataSync().buffer));
fs.writeFileSync(output, Buffer.concat(values));
