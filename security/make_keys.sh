#!/bin/bash
# SPDX-FileCopyrightText: 2026 The stewart_dynamics developers
# SPDX-License-Identifier: Apache-2.0

# Creates a certificate authority and, for the node and each process that it connects to, a folder
# with key, certificate, Fast DDS profile and environment: see README.md.

set -euo pipefail
umask 077

fail() {
  echo "make_keys.sh: $1" >&2
  exit 2
}

(($# >= 2)) || fail 'usage: make_keys.sh FOLDER NAME=ADDRESS:PORT ..., one for each process that the node connects to'
folder=$1
shift
[[ ! -e $folder ]] || fail "$folder: exists; keys are never overwritten"
octet='(25[0-5]|2[0-4][0-9]|1[0-9][0-9]|[1-9]?[0-9])'
names=' ca node '
for peer in "$@"; do
  [[ $peer =~ ^([a-z][a-z0-9_]*)=($octet\.$octet\.$octet\.$octet):([1-9][0-9]{0,4})$ ]] ||
    fail "$peer: must be NAME=ADDRESS:PORT, NAME of a-z 0-9 _, ADDRESS as 192.168.1.10"
  ((BASH_REMATCH[7] < 65536)) || fail "$peer: the port must be at most 65535"
  [[ $names != *" ${BASH_REMATCH[1]} "* ]] || fail "${BASH_REMATCH[1]}: given twice, or ca or node, which are created in any case"
  names+="${BASH_REMATCH[1]} "
done
command -v openssl > /dev/null || fail 'openssl: not installed'

# The folder gets its name only when it is complete.
mkdir -p "$(dirname "$folder")"
making=$(mktemp -d "$folder.XXXXXX")
trap 'rm -rf "$making"' EXIT

# Independent of the OpenSSL configuration of this computer.
export OPENSSL_CONF=$making/openssl.cnf
cat > "$OPENSSL_CONF" << 'END'
[req]
distinguished_name = name
[name]
[authority]
basicConstraints = critical, CA:true, pathlen:0
keyUsage = critical, keyCertSign
subjectKeyIdentifier = hash
[connects]
basicConstraints = critical, CA:false
keyUsage = critical, digitalSignature
extendedKeyUsage = critical, clientAuth
[listens]
basicConstraints = critical, CA:false
keyUsage = critical, digitalSignature
extendedKeyUsage = critical, serverAuth
END

run() {
  openssl "$@" 2> "$making/said" || fail "openssl $1: $(tail -n 1 "$making/said")"
}

# key NAME: a folder with a new private key in it.
key() {
  mkdir "$making/$1"
  run genpkey -algorithm EC -pkeyopt ec_paramgen_curve:P-256 -out "$making/$1/key.pem"
}

# certify NAME ROLE: a certificate that is good for this role and no other.
certify() {
  run req -new -key "$making/$1/key.pem" -subj "/CN=$1" -out "$making/request"
  run x509 -req -in "$making/request" -CA "$making/ca/cert.pem" -CAkey "$making/ca/key.pem" \
    -set_serial "0x$(run rand -hex 16)" -days 3650 -sha256 \
    -extfile "$OPENSSL_CONF" -extensions "$2" -out "$making/$1/cert.pem"
  cp "$making/ca/cert.pem" "$making/$1/ca.pem"
}

# profile NAME TRANSPORT PARTICIPANT: the Fast DDS profile; it has what is inside of two elements.
profile() {
  cat > "$making/$1/profile.xml" << END
<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <profiles>
    <transport_descriptors>
      <transport_descriptor>
        <transport_id>tls</transport_id>
        <type>TCPv4</type>
$2
        <!-- without it a message waits up to 5 ms -->
        <enable_tcp_nodelay>true</enable_tcp_nodelay>
        <tls>
          <private_key_file>\${STEWART_KEYS}/key.pem</private_key_file>
          <cert_chain_file>\${STEWART_KEYS}/cert.pem</cert_chain_file>
          <verify_file>\${STEWART_KEYS}/ca.pem</verify_file>
          <verify_mode>
            <verify>VERIFY_PEER</verify>
          </verify_mode>
          <options>
            <option>NO_SSLV2</option>
            <option>NO_SSLV3</option>
            <option>NO_TLSV1</option>
            <option>NO_TLSV1_1</option>
          </options>
        </tls>
      </transport_descriptor>
    </transport_descriptors>
    <participant profile_name="tls" is_default_profile="true">
      <rtps>
        <userTransports>
          <transport_id>tls</transport_id>
        </userTransports>
        <useBuiltinTransports>false</useBuiltinTransports>
$3
      </rtps>
    </participant>
  </profiles>
</dds>
END
  # What stays empty is no line.
  sed -i '/^$/d' "$making/$1/profile.xml"
}

# environment NAME [LINE]: what its process needs, for `.` in bash.
environment() {
  cat > "$making/$1/environment.sh" << END
STEWART_KEYS=\$(cd "\$(dirname "\${BASH_SOURCE[0]}")" && pwd)
export STEWART_KEYS FASTRTPS_DEFAULT_PROFILES_FILE="\$STEWART_KEYS/profile.xml"
# The name of the same in Kilted.
export FASTDDS_DEFAULT_PROFILES_FILE="\$FASTRTPS_DEFAULT_PROFILES_FILE"
export ROS_AUTOMATIC_DISCOVERY_RANGE=SYSTEM_DEFAULT SKIP_DEFAULT_XML_FILE=1
export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
${2:-unset OPENSSL_CONF}
unset ROS_LOCALHOST_ONLY ROS_STATIC_PEERS ROS_DISCOVERY_SERVER FASTDDS_ENVIRONMENT_FILE
END
}

key ca
run req -new -x509 -key "$making/ca/key.pem" -subj '/CN=stewart_dynamics' -days 3650 -sha256 \
  -config "$OPENSSL_CONF" -extensions authority -out "$making/ca/cert.pem"

peers=''
for peer in "$@"; do
  name=${peer%%=*}
  address=${peer#*=}
  port=${address#*:}
  address=${address%:*}
  peers+="
            <locator>
              <tcpv4>
                <address>$address</address>
                <physical_port>$port</physical_port>
              </tcpv4>
            </locator>"
  key "$name"
  certify "$name" listens
  profile "$name" "        <listening_ports>
          <port>$port</port>
        </listening_ports>
        <interfaceWhiteList>
          <address>$address</address>
        </interfaceWhiteList>" ''
  environment "$name" 'export OPENSSL_CONF="$STEWART_KEYS/openssl.cnf"'
  # Fast DDS verifies the process that it connects to, but not one that connects to it: OpenSSL does
  # so here. In TLS 1.3 a rejected process would notice it late and connect again at once, which
  # delays the others.
  cat > "$making/$name/openssl.cnf" << 'END'
openssl_conf = all
[all]
ssl_conf = programs
[programs]
system_default = listener
[listener]
VerifyMode = Require
MinProtocol = TLSv1.2
MaxProtocol = TLSv1.2
END
done

key node
certify node connects
profile node '' "        <builtin>
          <initialPeersList>$peers
          </initialPeersList>
        </builtin>"
environment node

rm "$making/request" "$making/said" "$OPENSSL_CONF"
mv -T "$making" "$folder"
trap - EXIT
echo "$folder: keys of${names% }, good for ten years"
