"""Has the vendors' own SDKs check what we send and read what our test server answers.

Reads one JSON file: for each wire the requests of two flights, the events and the whole answer of the test server, and the
server's address. Says "NAME agrees" for each, or fails with what does not.
"""

import json
import sys
import warnings

import pydantic

# The SDKs' enumerations are open: an unknown value only causes a warning, but must fail here.
warnings.simplefilter("error", UserWarning)


def walk(value):
    """Iterables of typed dictionaries are checked only when they are walked."""
    if isinstance(value, dict):
        return {key: walk(item) for key, item in value.items()}
    if isinstance(value, (str, bytes, int, float, bool, type(None))):
        return value
    if hasattr(value, "__iter__"):
        return [walk(item) for item in value]
    return value


def typed(adapter, value, ignore=()):
    """Checks a value by a typed dictionary, which drops unknown keys in silence: what comes back must be the same."""
    got = walk(adapter.validate_python(value))
    left = {key: item for key, item in value.items() if key not in ignore}
    assert json.loads(json.dumps(got)) == left, f"keys were dropped:\n{got}\n{left}"


def gemini(work):
    from google import genai
    from google.genai import types

    levels = {level.value for level in types.ThinkingLevel}
    resolutions = {resolution.value for resolution in types.MediaResolution}
    for body in work["requests"]:
        assert set(body) <= {"contents", "systemInstruction", "generationConfig", "safetySettings", "serviceTier"}, set(body)
        for content in body["contents"]:
            picture = types.Content.model_validate(content).parts[0].inline_data
            assert picture.mime_type == "image/jpeg" and picture.data[:2] == b"\xff\xd8"
        config = body["generationConfig"]
        types.GenerationConfig.model_validate(config)
        assert config["thinkingConfig"]["thinkingLevel"] in levels and config["mediaResolution"] in resolutions
    for event in work["events"] + [work["whole"]]:
        types.GenerateContentResponse.model_validate(event)
    client = genai.Client(api_key="K", http_options={"base_url": work["url"].removesuffix("/v1"), "timeout": 8000})
    whole = client.models.generate_content(model="m", contents="Where?")
    assert whole.text == work["text"], whole
    streamed = "".join(chunk.text or "" for chunk in client.models.generate_content_stream(model="m", contents="Where?"))
    assert streamed == work["text"], streamed


def openai(work):
    import openai
    from openai.types.responses import Response, ResponseStreamEvent
    from openai.types.responses.response_create_params import ResponseCreateParamsStreaming

    adapter = pydantic.TypeAdapter(ResponseCreateParamsStreaming)
    for body in work["requests"]:
        typed(adapter, body)
    events = pydantic.TypeAdapter(ResponseStreamEvent)
    for event in work["events"]:
        events.validate_python(event)
    Response.model_validate(work["whole"])
    client = openai.OpenAI(api_key="K", base_url=work["url"], max_retries=0, timeout=8)
    whole = client.responses.create(model="m", input="Where?")
    assert whole.output_text == work["text"], whole
    stream = client.responses.create(model="m", input="Where?", stream=True)
    streamed = "".join(event.delta for event in stream if event.type == "response.output_text.delta")
    assert streamed == work["text"], streamed


def chat(work):
    import openai
    from openai.types.chat import ChatCompletion, ChatCompletionChunk
    from openai.types.chat.completion_create_params import CompletionCreateParamsStreaming

    adapter = pydantic.TypeAdapter(CompletionCreateParamsStreaming)
    for body in work["requests"]:
        # A parameter of vLLM and llama.cpp, which their users send as the SDK's `extra_body`.
        typed(adapter, body, ignore=("chat_template_kwargs",))
    for event in work["events"]:
        ChatCompletionChunk.model_validate(event)
    ChatCompletion.model_validate(work["whole"])
    client = openai.OpenAI(api_key="K", base_url=work["url"], max_retries=0, timeout=8)
    ask = {"model": "m", "messages": [{"role": "user", "content": "Where?"}]}
    whole = client.chat.completions.create(**ask)
    assert whole.choices[0].message.content == work["text"], whole
    chunks = list(client.chat.completions.create(**ask, stream=True, stream_options={"include_usage": True}))
    streamed = "".join(chunk.choices[0].delta.content or "" for chunk in chunks if chunk.choices)
    assert streamed == work["text"] and chunks[-1].usage.prompt_tokens == 1200, chunks


def anthropic(work):
    import anthropic
    from anthropic.types import Message, RawMessageStreamEvent
    from anthropic.types.message_create_params import MessageCreateParamsStreaming

    adapter = pydantic.TypeAdapter(MessageCreateParamsStreaming)
    for body in work["requests"]:
        typed(adapter, body)
    events = pydantic.TypeAdapter(RawMessageStreamEvent)
    for event in work["events"]:
        # The client removes pings before its types see them.
        if event["type"] != "ping":
            events.validate_python(event)
    Message.model_validate(work["whole"])
    client = anthropic.Anthropic(api_key="K", base_url=work["url"].removesuffix("/v1"), max_retries=0, timeout=8)
    ask = {"model": "m", "max_tokens": 100, "messages": [{"role": "user", "content": "Where?"}]}
    whole = client.messages.create(**ask)
    assert whole.content[0].text == work["text"], whole
    with client.messages.stream(**ask) as stream:
        assert "".join(stream.text_stream) == work["text"]


def main():
    wires = {"gemini": gemini, "openai": openai, "chat": chat, "anthropic": anthropic}
    with open(sys.argv[1], encoding="utf-8") as file:
        for work in json.load(file):
            wires[work["vendor"]](work)
            print(work["vendor"], "agrees", flush=True)


main()
