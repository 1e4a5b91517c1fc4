//! Private certificate authorities and proxies: settings from a process's environment.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ServerConfig, ServerConnection, StreamOwned};
use spf_vlm::check::{USUAL_CAMERA, Verdict, check};
use spf_vlm::setup::Access;
use spf_vlm::table::Table;
use spf_vlm::{RequestOptions, setup};
use tempfile::TempDir;

/// The server's address for the querying process.
const ADDRESS: &str = "SPF_TEST_ADDRESS";
/// Maximum wait for anything here.
const PATIENCE: Duration = Duration::from_secs(30);

/// Whether openssl exists; with `CI=true` it must.
fn have_openssl() -> bool {
    let there = Command::new("openssl").arg("version").output().is_ok();
    assert!(there || std::env::var("CI").as_deref() != Ok("true"), "`openssl` is missing: install Debian's package `openssl`");
    if !there {
        eprintln!("NOT CHECKED: `openssl` is missing, so this test did not run");
    }
    there
}

/// An authority that no system trusts, and a server certified by it.
struct Server {
    address: SocketAddr,
    /// The file of the authority's certificate.
    authority: String,
    _folder: TempDir,
}

impl Server {
    fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).into_os_string().into_string().unwrap();
        let certificate = |name: &str, more: &[&str]| {
            let (key, certificate) = (path(&format!("{name}.key")), path(&format!("{name}.pem")));
            let mut openssl = Command::new("openssl");
            openssl.args("req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj".split(' '));
            openssl.args([&format!("/CN={name}"), "-keyout", &key, "-out", &certificate]).args(more);
            let output = openssl.output().unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            (PrivateKeyDer::from_pem_file(key).unwrap(), CertificateDer::from_pem_file(certificate).unwrap())
        };
        certificate("authority", &[]);
        let (authority, authority_key) = (path("authority.pem"), path("authority.key"));
        let vouched = ["-CA", &authority, "-CAkey", &authority_key, "-addext", "subjectAltName=IP:127.0.0.1"];
        let (key, certificate) =
            certificate("server", &[&vouched[..], &["-addext", "basicConstraints=critical,CA:FALSE"]].concat());
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
        let config = Arc::new(config.with_no_client_auth().with_single_cert(vec![certificate], key).unwrap());
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        serve(listener, move |stream| {
            let connection = ServerConnection::new(config.clone()).unwrap();
            // A client that does not trust us disconnects.
            let _ = answer(StreamOwned::new(connection, stream));
        });
        Self { address, authority, _folder: folder }
    }
}

/// Serves each connection in a thread of its own.
fn serve(listener: TcpListener, connection: impl Fn(TcpStream) + Send + Sync + 'static) {
    let connection = Arc::new(connection);
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            stream.set_read_timeout(Some(PATIENCE)).unwrap();
            let connection = connection.clone();
            std::thread::spawn(move || connection(stream));
        }
    });
}

/// Lines up to an empty one.
fn head(reader: &mut impl BufRead) -> std::io::Result<Vec<String>> {
    let mut lines = Vec::new();
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line)? == 0 || line == "\r\n" {
            return Ok(lines);
        }
        lines.push(line.to_lowercase());
    }
}

/// Answers every query on a connection in the form of chat completions.
fn answer(stream: impl Read + Write) -> std::io::Result<()> {
    let mut reader = BufReader::new(stream);
    loop {
        let lines = head(&mut reader)?;
        if lines.is_empty() {
            return Ok(());
        }
        let length = lines.iter().find_map(|line| line.strip_prefix("content-length:")).map_or("0", str::trim);
        let mut body = vec![0; length.parse().unwrap()];
        reader.read_exact(&mut body)?;
        let reply = r#"{"status":"navigating","look":null,"stage":1,"point":[500,500],"depth":3,"target":"dot"}"#;
        let message =
            serde_json::json!({ "model": "m", "choices": [{ "message": { "content": reply }, "finish_reason": "stop" }] });
        let message = message.to_string();
        let stream = reader.get_mut();
        write!(
            stream,
            "HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n{message}",
            message.len()
        )?;
        stream.flush()?;
    }
}

/// A proxy that opens tunnels, and counts them.
fn proxy() -> (SocketAddr, Arc<AtomicU32>) {
    let (listener, tunnels) = (TcpListener::bind("127.0.0.1:0").unwrap(), Arc::new(AtomicU32::new(0)));
    let (address, counted) = (listener.local_addr().unwrap(), tunnels.clone());
    serve(listener, move |mut client| {
        let lines = head(&mut BufReader::new(&client)).unwrap();
        let target = lines[0].strip_prefix("connect ").unwrap().split(' ').next().unwrap().to_owned();
        let mut server = TcpStream::connect(target).unwrap();
        client.write_all(b"HTTP/1.1 200 Connected\r\n\r\n").unwrap();
        counted.fetch_add(1, Ordering::SeqCst);
        let (mut back, mut to) = (server.try_clone().unwrap(), client.try_clone().unwrap());
        std::thread::spawn(move || std::io::copy(&mut back, &mut to));
        // Ends when either side disconnects.
        let _ = std::io::copy(&mut client, &mut server);
    });
    (address, tunnels)
}

/// Output of a separate process that queries a model at this address, with only these variables of the kind.
fn requested(address: SocketAddr, variables: &[(&str, &str)]) -> String {
    let mut process = Command::new(std::env::current_exe().unwrap());
    process.args(["--exact", "network::ask", "--ignored", "--nocapture"]).env(ADDRESS, address.to_string());
    for name in ["SSL_CERT_FILE", "SSL_CERT_DIR", "HTTPS_PROXY", "HTTP_PROXY", "ALL_PROXY", "NO_PROXY"] {
        process.env_remove(name).env_remove(name.to_lowercase());
    }
    let output = process.envs(variables.iter().copied()).output().unwrap();
    String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap()
}

#[test]
#[ignore = "asks what the variables of its process say; the other tests start it"]
fn ask() {
    let Ok(address) = std::env::var(ADDRESS) else { return };
    let variables = |_: &str| None;
    let name = format!("vllm@https://{address}");
    let remote = setup::remote(&Table::shipped(), &[name.as_str().into()], Access::of(&variables), RequestOptions::default());
    let mut remote = match remote {
        Ok(remote) => remote,
        Err(error) => return println!("NOT SET UP {error}"),
    };
    match check(&mut remote, Duration::from_secs(10), USUAL_CAMERA).verdict {
        Verdict::Failed(error) => println!("FAILED {error}"),
        verdict => println!("ANSWERED {verdict:?}"),
    }
}

#[test]
#[ignore = "needs openssl: .ci/interop runs it"]
fn an_authority_of_ones_own_is_trusted_when_named() {
    if !have_openssl() {
        return;
    }
    let server = Server::start();
    let refused = requested(server.address, &[]);
    assert!(refused.contains("FAILED") && refused.contains("UnknownIssuer") && refused.contains("SSL_CERT_FILE"), "{refused}");
    let trusted = requested(server.address, &[("SSL_CERT_FILE", &server.authority)]);
    assert!(trusted.contains("ANSWERED"), "{trusted}");
    // Another authority's file does not help.
    let other = Server::start();
    let refused = requested(server.address, &[("SSL_CERT_FILE", &other.authority)]);
    assert!(refused.contains("FAILED") && refused.contains("invalid peer certificate"), "{refused}");
    let missing = requested(server.address, &[("SSL_CERT_FILE", "/no/such/file")]);
    assert!(missing.contains("NOT SET UP") && missing.contains("certificates"), "{missing}");
}

#[test]
#[ignore = "needs openssl: .ci/interop runs it"]
fn questions_go_through_a_proxy_unless_excepted() {
    if !have_openssl() {
        return;
    }
    let (server, (proxy, tunnels)) = (Server::start(), proxy());
    let (authority, proxy) = (server.authority.as_str(), format!("http://{proxy}"));
    let through = requested(server.address, &[("SSL_CERT_FILE", authority), ("HTTPS_PROXY", &proxy)]);
    assert!(through.contains("ANSWERED"), "{through}");
    let opened = tunnels.load(Ordering::SeqCst);
    assert!(opened > 0);
    let past = requested(server.address, &[("SSL_CERT_FILE", authority), ("HTTPS_PROXY", &proxy), ("NO_PROXY", "127.0.0.1")]);
    assert!(past.contains("ANSWERED"), "{past}");
    assert_eq!(tunnels.load(Ordering::SeqCst), opened);
    // A missing proxy is reported.
    let gone = requested(server.address, &[("SSL_CERT_FILE", authority), ("HTTPS_PROXY", "http://127.0.0.1:1")]);
    assert!(gone.contains("FAILED") && gone.contains("cannot reach"), "{gone}");
}
