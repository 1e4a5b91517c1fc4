"""The vendors' own SDKs, unmodified, ask the endpoint: whole, streamed, with structured output."""

import base64
import json
import sys
import typing
import urllib.request

import anthropic
import openai
import pydantic
from google import genai
from google.genai import types


class Answer(pydantic.BaseModel):
    status: typing.Literal["navigating", "not_visible", "done"]
    look: typing.Optional[str]
    stage: typing.Optional[int]
    point: typing.Optional[list[int]]
    depth: typing.Optional[int]
    target: typing.Optional[str]


def frame(url):
    with urllib.request.urlopen(url + "/frame.jpg") as response:
        return response.read()


def check(text):
    answer = Answer.model_validate_json(text)
    assert answer.status == "navigating" and len(answer.point) == 2 and 1 <= answer.depth <= 10, text
    return answer


def ask_openai(url, prompt):
    client = openai.OpenAI(api_key="none", base_url=url + "/v1", max_retries=0, timeout=30)

    def chat():
        image = {"type": "image_url", "image_url": {"url": "data:image/jpeg;base64," + base64.b64encode(frame(url)).decode()}}
        return {"model": "m", "messages": [{"role": "user", "content": [image, {"type": "text", "text": prompt}]}]}

    check(client.chat.completions.create(**chat()).choices[0].message.content)
    chunks = list(client.chat.completions.create(**chat(), stream=True, stream_options={"include_usage": True}))
    check("".join(chunk.choices[0].delta.content or "" for chunk in chunks if chunk.choices))
    assert chunks[-1].usage.total_tokens > 0
    assert client.chat.completions.parse(**chat(), response_format=Answer).choices[0].message.parsed.status == "navigating"

    def responses():
        image = {"type": "input_image", "detail": "auto", "image_url": "data:image/jpeg;base64," + base64.b64encode(frame(url)).decode()}
        return {"model": "m", "input": [{"role": "user", "content": [image, {"type": "input_text", "text": prompt}]}]}

    check(client.responses.create(**responses()).output_text)
    stream = client.responses.create(**responses(), stream=True)
    check("".join(event.delta for event in stream if event.type == "response.output_text.delta"))
    assert client.responses.parse(**responses(), text_format=Answer).output_parsed.status == "navigating"
    try:
        client.chat.completions.create(model="m", messages=[{"role": "user", "content": "Where?"}])
        raise AssertionError("no picture, and an answer")
    except openai.UnprocessableEntityError as error:
        assert "no image" in str(error), error


def ask_anthropic(url, prompt):
    client = anthropic.Anthropic(api_key="none", base_url=url, max_retries=0, timeout=30)

    def ask():
        source = {"type": "base64", "media_type": "image/jpeg", "data": base64.b64encode(frame(url)).decode()}
        content = [{"type": "image", "source": source}, {"type": "text", "text": prompt}]
        return {"model": "m", "max_tokens": 500, "messages": [{"role": "user", "content": content}]}

    check(client.messages.create(**ask()).content[0].text)
    with client.messages.stream(**ask()) as stream:
        check("".join(stream.text_stream))
        assert stream.get_final_message().stop_reason == "end_turn"
    schema = {"type": "json_schema", "schema": Answer.model_json_schema()}
    check(client.messages.create(**ask(), output_config={"format": schema}).content[0].text)


def ask_gemini(url, prompt):
    client = genai.Client(api_key="none", http_options={"base_url": url, "timeout": 30000})

    def ask():
        return {"model": "m", "contents": [types.Part.from_bytes(data=frame(url), mime_type="image/jpeg"), prompt]}

    check(client.models.generate_content(**ask()).text)
    check("".join(part.text for part in client.models.generate_content_stream(**ask())))
    config = {"response_mime_type": "application/json", "response_schema": Answer}
    assert client.models.generate_content(**ask(), config=config).parsed.status == "navigating"


def main():
    url, prompt = sys.argv[1:]
    for ask in (ask_openai, ask_anthropic, ask_gemini):
        ask(url, prompt)
        print(ask.__name__, "agrees", flush=True)


main()
