# The server with PostgreSQL support. Built and run by docker compose; see docs/install.md.
FROM python:3.12-slim AS build
WORKDIR /src
COPY . .
RUN pip wheel --no-cache-dir --wheel-dir /wheels -c constraints.txt '.[server,postgres]'

FROM python:3.12-slim
RUN useradd --create-home --uid 10001 tms
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir --no-index --find-links /wheels 'robot-town-tms[server,postgres]' && rm -rf /wheels
RUN mkdir -p /var/lib/tms && chown tms /var/lib/tms
USER tms
ENV TMS_DATA_DIR=/var/lib/tms TMS_HOST=0.0.0.0 TMS_PORT=8080
VOLUME /var/lib/tms
EXPOSE 8080
HEALTHCHECK --interval=10s --timeout=3s --start-period=60s \
  CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8080/readyz', timeout=2)"]
CMD ["tms", "serve"]
