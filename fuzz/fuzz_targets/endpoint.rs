//! Any bytes as a request to the VLM endpoint, in every vendor's form, and as headers: read or refused, never a page of
//! another site let in.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_guard::Access;

fuzz_target!(|bytes: &[u8]| {
    spf_serve::vlm::read_any_request(bytes);
    // The same bytes as the Host and Origin headers, a line each.
    let mut lines = bytes.split(|byte| *byte == b'\n');
    let mut headers = http::HeaderMap::new();
    for name in [http::header::HOST, http::header::ORIGIN] {
        if let Some(value) = lines.next().and_then(|line| http::HeaderValue::from_bytes(line).ok()) {
            headers.append(name, value);
        }
    }
    let access = Access::at(([127, 0, 0, 1], 8000).into());
    if access.check(&http::Method::GET, &headers).is_ok() {
        let text = |name| headers.get(name).map(|value| value.to_str().expect("only text is let in").to_lowercase());
        let host = text(http::header::HOST).expect("nobody is let in without a Host header");
        assert!(host.starts_with("127.") || host.starts_with("localhost") || host.starts_with('['), "{host}");
        if let Some(origin) = text(http::header::ORIGIN) {
            assert!(origin.ends_with(&host), "{origin}");
        }
    }
});
