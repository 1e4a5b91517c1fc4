//! A relay on this machine between the library, which makes its own connections, and the camera: what the camera sends passes the
//! [`Repair`].

use std::net::Ipv4Addr;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};

use super::repair::Repair;

/// Connects to a camera, and returns the port of this machine at which one connection is passed on to it. It is passed on as long as
/// the runtime lives.
pub(super) async fn to(host: &str, port: u16) -> std::io::Result<u16> {
    let camera = TcpStream::connect((host, port)).await?;
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
    let local = listener.local_addr()?.port();
    tokio::spawn(async move {
        let relayed = async {
            let (library, _) = listener.accept().await?;
            drop(listener);
            relay(library, camera).await
        };
        if let Err(error) = relayed.await {
            tracing::debug!(%error, "the connection to the camera ended");
        }
    });
    Ok(local)
}

/// Passes on until either side ends.
async fn relay(library: TcpStream, camera: TcpStream) -> std::io::Result<()> {
    // An image is to be passed on at once, and so is a request.
    library.set_nodelay(true)?;
    camera.set_nodelay(true)?;
    let (mut from_library, mut to_library) = library.into_split();
    let (mut from_camera, mut to_camera) = camera.into_split();
    let up = tokio::io::copy(&mut from_library, &mut to_camera);
    let down = async {
        let (mut repair, mut buffer, mut out) = (Repair::default(), vec![0; 1 << 16], Vec::new());
        loop {
            let length = from_camera.read(&mut buffer).await?;
            if length == 0 {
                return std::io::Result::Ok(());
            }
            let before = repair.skipped();
            repair.push(&buffer[..length], &mut out);
            if repair.skipped() > before {
                tracing::trace!("{} bytes between the camera's packets so far", repair.skipped());
            }
            to_library.write_all(&out).await?;
            out.clear();
        }
    };
    tokio::select! {
        ended = up => ended.map(drop),
        ended = down => ended,
    }
}
