#!/usr/bin/env python3
"""A skeleton for using a vision-language model from the `transformers` library as `spf`'s VLM.

    spf vlm check "exec:python3 examples/exec_transformers.py Qwen/Qwen3-VL-2B-Instruct"
    spf fly "fly to the red crane" --vlm "exec:python3 examples/exec_transformers.py Qwen/Qwen3-VL-2B-Instruct"

The prompt asks for pixels of the image, in the order x, y. A model that was trained on other coordinates points better if
it is asked for those: change the query's `prompt` and convert the reply, both in `answer`. Needs torch, transformers and Pillow.

Without a model (`--dry-run`) it answers every query with `not_visible`, to show that the lines are exchanged correctly.
"""

import json
import sys


def load(name):
    """The model as a function from image and prompt to text."""
    import torch
    from PIL import Image
    from transformers import AutoModelForImageTextToText, AutoProcessor

    processor = AutoProcessor.from_pretrained(name)
    model = AutoModelForImageTextToText.from_pretrained(name, dtype="auto", device_map="auto")

    def generate(path, prompt):
        content = [{"type": "image", "image": Image.open(path).convert("RGB")}, {"type": "text", "text": prompt}]
        inputs = processor.apply_chat_template(
            [{"role": "user", "content": content}],
            add_generation_prompt=True,
            tokenize=True,
            return_dict=True,
            return_tensors="pt",
        ).to(model.device)
        with torch.inference_mode():
            tokens = model.generate(**inputs, max_new_tokens=400, do_sample=False)
        return processor.decode(tokens[0, inputs["input_ids"].shape[1] :], skip_special_tokens=True)

    return generate


def dry_run(_path, _prompt):
    return '{"status": "not_visible", "look": "right", "stage": 1, "point": null, "depth": null, "target": null, "boxes": []}'


def answer(generate, query):
    if query["kind"] == "declare":
        # Asked once, before take-off: whether the answers list obstacles. A model that only points says False.
        return {"id": query["id"], "boxes": True}
    try:
        # The text as the model wrote it: `spf` finds the JSON in it.
        return {"id": query["id"], "text": generate(query["image"], query["prompt"])}
    except Exception as error:
        return {"id": query["id"], "error": f"{type(error).__name__}: {error}"}


def main():
    name = sys.argv[1]
    generate = dry_run if name == "--dry-run" else load(name)
    print(f"{name} is ready", file=sys.stderr)
    for line in sys.stdin:
        print(json.dumps(answer(generate, json.loads(line))), flush=True)


main()
