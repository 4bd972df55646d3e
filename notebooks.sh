. /tmp/h46/t.sh; mkdir -p /tmp/h46/nb; cd /tmp/h46/nb
t python -m release.notebooks --help
