//! Streams of a model whose row says that it does not think.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use spf_core::frame::FrameId;
use spf_core::query::{Query, QueryId, QueryKind};
use spf_vlm::setup::Access;
use spf_vlm::table::Table;
use spf_vlm::{QueryImage, QueryRequest, RequestOptions, Vlm, VlmError, setup};

const PATIENCE: Duration = Duration::from_secs(20);
const REPLY: &str = r#"{"status":"navigating","point":[500,500],"depth":3}"#;

struct Grey;

impl QueryImage for Grey {
    fn size(&self) -> (u32, u32) {
        (64, 48)
    }

    fn jpeg(&mut self, _: (u32, u32), _: u8) -> Result<Arc<[u8]>, VlmError> {
        Ok(Arc::new([0xff, 0xd8]))
    }
}

/// Answers each request with two events, the second a while after the first.
fn answer(stream: TcpStream, pieces: &[String; 2]) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    let (mut reader, mut length) = (BufReader::new(stream), 0);
    let mut line = String::new();
    while reader.read_line(&mut line)? > 0 && line != "\r\n" {
        if let Some(size) = line.to_lowercase().strip_prefix("content-length:") {
            length = size.trim().parse().unwrap();
        }
        line.clear();
    }
    reader.read_exact(&mut vec![0; length])?;
    let stream = reader.get_mut();
    write!(stream, "HTTP/1.1 200 OK\r\ncontent-type: text/event-stream\r\nconnection: close\r\n\r\n")?;
    for piece in pieces {
        let event = serde_json::json!({ "model": "m", "choices": [{ "delta": { "content": piece } }] });
        write!(stream, "data: {event}\n\n")?;
        stream.flush()?;
        std::thread::sleep(Duration::from_millis(300));
    }
    let end = serde_json::json!({ "model": "m", "choices": [{ "delta": {}, "finish_reason": "stop" }] });
    write!(stream, "data: {end}\n\ndata: [DONE]\n\n")
}

/// What two queries, one after the other, read of the same stream.
fn read_of(pieces: [String; 2]) -> [String; 2] {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            // Whoever has read enough closes the connection.
            let _ = answer(stream, &pieces);
        }
    });
    let rows = "[[series]]\nvendor = \"vllm\"\nmatch = [\"quick\"]\nthinks = false\n";
    let table = Table::shipped().extended(rows).unwrap();
    let (nothing, name) = (|_: &str| None, format!("vllm#quick@http://{address}"));
    let mut remote = setup::remote(&table, &[name.as_str().into()], Access::of(&nothing), RequestOptions::default()).unwrap();
    let query = Query {
        instruction: "to the crane".to_owned(),
        prompt: "Where?".to_owned(),
        ..Query::new(QueryId(7), FrameId(7), QueryKind::point(false))
    };
    [(); 2].map(|()| remote.answer(&QueryRequest::new(&query, PATIENCE), &mut Grey).text.unwrap())
}

#[test]
fn a_stream_is_cut_off_after_its_reply_until_one_had_a_draft() {
    let plain = [REPLY, " That is it."].map(str::to_owned);
    assert_eq!(read_of(plain), [REPLY, REPLY]);
    let thought = format!("so</think>{REPLY}");
    assert_eq!(read_of([thought.clone(), " done".to_owned()]), [thought.clone(), thought + " done"]);
    let both = format!("{REPLY} no, {REPLY}");
    assert_eq!(read_of([both.clone(), " done".to_owned()]), [both.clone(), both + " done"]);
}
