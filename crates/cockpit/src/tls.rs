//! TLS with a certificate made at the start: nobody vouches for it, but its fingerprint can be compared.

use std::net::IpAddr;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use rcgen::{CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, KeyPair};
use rustls::ServerConfig;
use rustls::pki_types::PrivatePkcs8KeyDer;

/// The certificate is valid for this long, and began so long ago: clocks differ, and a program is restarted before it ends.
const VALID: Duration = Duration::from_secs(30 * 24 * 3600);
const BEFORE: Duration = Duration::from_secs(24 * 3600);

/// A made certificate. Its key is in memory only.
pub(crate) struct Tls {
    pub(crate) config: Arc<ServerConfig>,
    /// SHA-256 of the certificate, as browsers show it.
    pub(crate) fingerprint: String,
}

impl Tls {
    /// A new key and its certificate, for these addresses.
    pub(crate) fn new(addresses: &[IpAddr]) -> std::io::Result<Self> {
        let names = addresses.iter().map(IpAddr::to_string).chain(["localhost".to_owned()]).collect::<Vec<_>>();
        let mut params = CertificateParams::new(names).map_err(std::io::Error::other)?;
        params.distinguished_name = DistinguishedName::new();
        params.distinguished_name.push(DnType::CommonName, "SPF cockpit");
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
        let now = SystemTime::now();
        (params.not_before, params.not_after) = ((now - BEFORE).into(), (now + VALID).into());
        let key = KeyPair::generate().map_err(std::io::Error::other)?;
        let certificate = params.self_signed(&key).map_err(std::io::Error::other)?.der().clone();
        let digest = ring::digest::digest(&ring::digest::SHA256, &certificate);
        let fingerprint = digest.as_ref().iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(":");
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .and_then(|builder| {
                let key = PrivatePkcs8KeyDer::from(key.serialize_der()).into();
                builder.with_no_client_auth().with_single_cert(vec![certificate], key)
            })
            .map_err(std::io::Error::other)?;
        Ok(Self { config: Arc::new(config), fingerprint })
    }
}
